#include "active_matching_slam/image/corners.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <utility>

#include "active_matching_slam/image/subpixel.h"
#include "textures.h"

namespace active_matching_slam {
namespace {

double smallestDistance(const std::vector<Corner>& corners,
                        const std::vector<Eigen::Vector2d>& occupied) {
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j)
      smallest = std::min(smallest, (corners[i].pixel - corners[j].pixel).norm());
    for (const Eigen::Vector2d& point : occupied)
      smallest = std::min(smallest, (corners[i].pixel - point).norm());
  }
  return smallest;
}

TEST(Corners, SpreadOverTheWholeImage) {
  const cv::Mat image = WaveTexture(41, 8.0).render(640, 480);
  const std::vector<Corner> corners = detectCorners(image, {}, 60, 20.0, ImageOptions());
  ASSERT_EQ(corners.size(), 60u);
  EXPECT_GE(smallestDistance(corners, {}), 20.0);
  std::set<std::pair<int, int>> quarters;  // of 4 x 4
  for (const Corner& corner : corners) {
    EXPECT_GT(corner.response, 0.0);
    quarters.insert(
        {static_cast<int>(corner.pixel.x() / 160), static_cast<int>(corner.pixel.y() / 120)});
  }
  EXPECT_GE(quarters.size(), 14u);
}

TEST(Corners, FillTheEmptyPartFirst) {
  const cv::Mat image = WaveTexture(42, 8.0).render(640, 480);
  std::vector<Eigen::Vector2d> occupied;
  for (int v = 20; v < 480; v += 40)
    for (int u = 20; u < 480; u += 40) occupied.push_back(Eigen::Vector2d(u, v));
  for (const Corner& corner : detectCorners(image, occupied, 5, 20.0, ImageOptions()))
    EXPECT_GT(corner.pixel.x(), 480.0);
}

TEST(Corners, KeepTheirDistanceFromOccupiedPoints) {
  const cv::Mat image = WaveTexture(43, 8.0).render(320, 240);
  std::vector<Eigen::Vector2d> occupied;
  for (int v = 0; v < 240; v += 50)
    for (int u = 0; u < 320; u += 50) occupied.push_back(Eigen::Vector2d(u + 0.3, v + 0.6));
  const std::vector<Corner> corners = detectCorners(image, occupied, 100, 18.0, ImageOptions());
  EXPECT_GT(corners.size(), 10u);
  EXPECT_GE(smallestDistance(corners, occupied), 18.0);
}

TEST(Corners, AreTheCornersOfSquares) {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(60));
  image(cv::Rect(100, 80, 60, 50)).setTo(180);
  const std::vector<Corner> corners = detectCorners(image, {}, 10, 15.0, ImageOptions());
  ASSERT_EQ(corners.size(), 4u);
  for (const Corner& corner : corners) {
    const double to_side_u =
        std::min(std::abs(corner.pixel.x() - 99.5), std::abs(corner.pixel.x() - 159.5));
    const double to_side_v =
        std::min(std::abs(corner.pixel.y() - 79.5), std::abs(corner.pixel.y() - 129.5));
    EXPECT_LE(to_side_u, 2.5);
    EXPECT_LE(to_side_v, 2.5);
  }
}

/// By how far a template around `point` misses it [px], root mean square, where the texture is
/// warped about it in ways that nobody foresaw.
double missUnderWarps(const WaveTexture& texture, const Eigen::Vector2d& point) {
  constexpr int kSide = 31, kMiddle = kSide / 2, kWarps = 20;
  const auto render = [&](const Eigen::Matrix2d& warp) {
    cv::Mat image(kSide, kSide, CV_8UC1);
    for (int v = 0; v < kSide; ++v)
      for (int u = 0; u < kSide; ++u) {
        const Eigen::Vector2d at = point + warp * Eigen::Vector2d(u - kMiddle, v - kMiddle);
        image.at<std::uint8_t>(v, u) = WaveTexture::toGrey(texture.value(at.x(), at.y()));
      }
    return image;
  };
  const Template patch = cutTemplate(render(Eigen::Matrix2d::Identity()), kMiddle, kMiddle);
  std::mt19937 generator(1);
  double squares = 0.0;
  for (int k = 0; k < kWarps; ++k) {
    Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
    for (int i = 0; i < 4; ++i) warp(i) += 0.1 * (generator() / 4294967296.0 - 0.5);
    const Eigen::Vector2d middle(kMiddle, kMiddle);
    const auto fit = refineSubpixel(render(warp), patch, middle);
    squares += fit ? (fit->pixel - middle).squaredNorm() : 1.0;
  }
  return std::sqrt(squares / kWarps);
}

TEST(Corners, LieWhereUnforeseenWarpsMoveThemLeast) {
  const WaveTexture texture(47, 8.0);
  double there = 0.0, beside = 0.0;
  for (const Corner& corner : detectCorners(texture.render(320, 240), {}, 30, 15.0, {})) {
    there += missUnderWarps(texture, corner.pixel);
    for (const auto& [u, v] : {std::make_pair(3, 0), {-3, 0}, {0, 3}, {0, -3}})
      beside += 0.25 * missUnderWarps(texture, corner.pixel + Eigen::Vector2d(u, v));
  }
  EXPECT_LT(there, 0.85 * beside);
}

TEST(Corners, LeaveRoomForASourcePatchAndSitOnWholePixels) {
  const ImageOptions options;
  const cv::Mat image = WaveTexture(44, 8.0).render(200, 150);
  for (const Corner& corner : detectCorners(image, {}, 100, 5.0, options)) {
    const double room = options.source_patch_size_px / 2;
    EXPECT_GE(corner.pixel.minCoeff(), room);
    EXPECT_LE(corner.pixel.x(), image.cols - 1 - room);
    EXPECT_LE(corner.pixel.y(), image.rows - 1 - room);
    EXPECT_EQ(corner.pixel, corner.pixel.array().round().matrix());
  }
}

TEST(Corners, AreTheSameEveryTime) {
  const cv::Mat image = WaveTexture(45, 8.0).render(320, 240);
  const std::vector<Corner> first = detectCorners(image, {{100, 100}}, 30, 15.0, ImageOptions());
  const std::vector<Corner> second = detectCorners(image, {{100, 100}}, 30, 15.0, ImageOptions());
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].pixel, second[i].pixel);
    EXPECT_EQ(first[i].response, second[i].response);
  }
}

TEST(Corners, AreNotInventedInNoise) {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(100));
  addNoise(&image, 1.5, 46);
  EXPECT_TRUE(detectCorners(image, {}, 20, 15.0, ImageOptions()).empty());
}

TEST(Corners, AreNoneWhereThereIsNoRoom) {
  const ImageOptions options;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(detectCorners(cv::Mat(), {}, 10, 15.0, options).empty());
  EXPECT_TRUE(detectCorners(randomImage(30, 200, 1), {}, 10, 15.0, options).empty());
  EXPECT_TRUE(detectCorners(cv::Mat(99, 99, CV_8UC3), {}, 10, 15.0, options).empty());
  EXPECT_TRUE(detectCorners(randomImage(99, 99, 1), {}, 0, 15.0, options).empty());
  EXPECT_TRUE(detectCorners(randomImage(99, 99, 1), {}, -3, 15.0, options).empty());
  EXPECT_FALSE(detectCorners(randomImage(99, 99, 1), {{nan, 4.0}}, 3, 15.0, options).empty());
  // A distance larger than the image leaves room for one only.
  EXPECT_EQ(detectCorners(randomImage(99, 99, 1), {}, 9, 500.0, options).size(), 1u);
}

}  // namespace
}  // namespace active_matching_slam
