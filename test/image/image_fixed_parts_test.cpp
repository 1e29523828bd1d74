// A camera before a picture on a wall, and what is burnt into its images.

#include "active_matching_slam/image/image_fixed_parts.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kImageWidth = 640, kImageHeight = 480;

CameraModel straightCamera() {
  CameraCalibration calibration;
  calibration.width = kImageWidth;
  calibration.height = kImageHeight;
  calibration.fx = calibration.fy = 500.0;
  calibration.cx = 319.5;
  calibration.cy = 239.5;
  return CameraModel(calibration);
}

cv::Mat speckles(cv::Size size, double grain_px, std::uint64_t seed) {
  cv::Mat noise(size, CV_32F), picture;
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  cv::GaussianBlur(noise, noise, {}, grain_px);
  cv::normalize(noise, picture, 20, 235, cv::NORM_MINMAX, CV_8U);
  return picture;
}

/// A wall at a distance of one, square to the first camera's axis, seen from `position` after a
/// turn about the upright axis [rad].
cv::Mat viewOfWall(const cv::Mat& wall, const cv::Vec3d& position, double turn) {
  const cv::Matx33d K(500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0);
  const cv::Matx33d R(std::cos(turn), 0.0, -std::sin(turn), 0.0, 1.0, 0.0, std::sin(turn), 0.0,
                      std::cos(turn));
  const cv::Matx33d at_wall(1.0, 0.0, -position[0], 0.0, 1.0, -position[1], 0.0, 0.0,
                            1.0 - position[2]);
  const cv::Matx33d picture(1.0 / 500.0, 0.0, -1.0, 0.0, 1.0 / 500.0, -0.8, 0.0, 0.0, 1.0);
  cv::Mat view;
  cv::warpPerspective(wall, view, K * R * at_wall * picture, {kImageWidth, kImageHeight});
  return view;
}

const cv::Mat& theWall() {
  static const cv::Mat wall = speckles({1000, 800}, 2.0, 1);
  return wall;
}

/// An image for half a second, in which a comparison with the one before comes to its end.
void show(const cv::Mat& image, int k, ImageFixedParts* parts) {
  for (int i = 0; i < 25; ++i)
    parts->add(straightCamera(), image, 0.5 * k + 0.02 * i, {}, ImageOptions());
}

/// Some seconds of images, `change` applied to each.
template <class View, class Change>
ImageFixedParts watch(const View& view, const Change& change) {
  ImageFixedParts parts;
  for (int k = 0; k < 12; ++k) {
    cv::Mat image = view(k);
    change(k, &image);
    show(image, k, &parts);
  }
  return parts;
}

cv::Mat handHeld(int k) {
  return viewOfWall(theWall(), {0.02 * k, 0.01 * k, 0.01 * k}, 0.02 * std::sin(0.9 * k));
}
void asItIs(int, cv::Mat*) {}

/// Shares of `area` and of the rest that are taken to be fixed.
std::pair<double, double> sharesOf(const ImageFixedParts& parts, const cv::Rect& area) {
  if (parts.fixed().empty()) return {0.0, 0.0};
  cv::Mat inside = cv::Mat::zeros(parts.fixed().size(), CV_8U);
  inside(area) = 255;
  const double all = static_cast<double>(parts.fixed().total());
  return {cv::countNonZero(parts.fixed() & inside) / static_cast<double>(area.area()),
          cv::countNonZero(parts.fixed() & ~inside) / (all - area.area())};
}

TEST(ImageFixedParts, NothingOfASceneIsFixed) { EXPECT_LT(watch(handHeld, asItIs).share(), 0.005); }

TEST(ImageFixedParts, AGripperBeforeTheCameraIs) {
  const cv::Rect place(200, 280, 240, 200);
  const cv::Mat gripper = speckles(place.size(), 2.0, 2);
  const auto [inside, outside] = sharesOf(
      watch(handHeld, [&](int, cv::Mat* image) { gripper.copyTo((*image)(place)); }), place);
  EXPECT_GT(inside, 0.8);
  EXPECT_LT(outside, 0.02);
}

TEST(ImageFixedParts, AsSoonAsItHasMovedAndNoLongerOnceItIsGone) {
  const cv::Rect place(100, 100, 120, 120);
  const cv::Mat gripper = speckles(place.size(), 2.0, 2);
  ImageFixedParts parts;
  for (int k = 0; k < 6; ++k) {
    cv::Mat image = handHeld(k);
    gripper.copyTo(image(place));
    show(image, k, &parts);
  }
  EXPECT_TRUE(parts.contains({160.0, 160.0}));
  EXPECT_FALSE(parts.contains({400.0, 300.0}));
  EXPECT_EQ(parts.sceneCentres(cv::Mat()).at<uchar>(160, 160), 0);
  EXPECT_EQ(parts.sceneCentres(cv::Mat()).at<uchar>(300, 400), 255);
  for (int k = 6; k < 16; ++k) show(handHeld(k), k, &parts);
  EXPECT_FALSE(parts.contains({160.0, 160.0}));
}

TEST(ImageFixedParts, ATimeThatRunsBackIsFollowedAfterAReset) {
  const cv::Rect place(100, 100, 120, 120);
  const cv::Mat gripper = speckles(place.size(), 2.0, 2);
  ImageFixedParts parts;
  for (const int first : {1000, 0}) {
    parts.reset();
    EXPECT_EQ(parts.share(), 0.0);
    for (int k = 0; k < 6; ++k) {
      cv::Mat image = handHeld(k);
      gripper.copyTo(image(place));
      show(image, first + k, &parts);
    }
    EXPECT_TRUE(parts.contains({160.0, 160.0})) << first;
  }
}

TEST(ImageFixedParts, NothingIsJudgedByACameraAtRest) {
  // Somebody walks by.
  const cv::Mat person = speckles({150, 400}, 2.0, 3);
  const auto parts = watch(
      [](int) {
        return viewOfWall(theWall(), {0.0, 0.0, 0.0}, 0.0);
      },
      [&](int k, cv::Mat* image) {
        person.copyTo((*image)({20 + 40 * k, 60, 150, 400}));
      });
  EXPECT_EQ(parts.share(), 0.0);
}

TEST(ImageFixedParts, WhatIsFarAheadOfACarIsOfTheScene) {
  // Far away in the middle, and the road on both sides of it.
  const cv::Mat far = speckles({160, 120}, 2.0, 4);
  const auto parts = watch(
      [](int k) {
        return viewOfWall(theWall(), {0.0, 0.0, 0.03 * k}, 0.0);
      },
      [&](int, cv::Mat* image) {
        far.copyTo((*image)({240, 180, 160, 120}));
      });
  EXPECT_LT(parts.share(), 0.005);
}

TEST(ImageFixedParts, AnEdgeThatMovesAlongItselfIsNot) {
  const auto parts = watch(
      [](int k) {
        cv::Mat bars(kImageHeight, kImageWidth, CV_8U);
        for (int v = 0; v < bars.rows; ++v) bars.row(v) = (v / 24) % 2 == 0 ? 60 : 190;
        const cv::Mat wall = speckles({1200, kImageHeight}, 2.0, 5);
        wall({25 * k, 0, kImageWidth, kImageHeight}).copyTo(bars, bars > 100);
        cv::Mat image;
        cv::warpAffine(bars, image, cv::getRotationMatrix2D({320.0F, 240.0F}, 0.0, 1.0),
                       bars.size());
        return image;
      },
      asItIs);
  EXPECT_LT(parts.share(), 0.005);
}

}  // namespace
}  // namespace active_matching_slam
