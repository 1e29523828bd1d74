#include "active_matching_slam/image/image_motion.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "textures.h"

namespace active_matching_slam {
namespace {

constexpr int kWidth = 320, kHeight = 240;

ImageMotion shiftedBy(double u, double v) {
  ImageMotion motion;
  motion.shift_px = Eigen::Vector2d(u, v);
  return motion;
}

/// Largest distance [px], over the image's quarters, of where two motions put a pixel.
double farthest(const ImageMotion& a, const ImageMotion& b) {
  double distance = 0.0;
  for (const double u : {0.25 * kWidth, 0.75 * kWidth})
    for (const double v : {0.25 * kHeight, 0.75 * kHeight})
      distance = std::max(distance, (a({u, v}) - b({u, v})).norm());
  return distance;
}

cv::Mat checkerboard(int width, int height, int square) {
  cv::Mat board(height, width, CV_8UC1);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      board.at<std::uint8_t>(v, u) = (u / square + v / square) % 2 == 0 ? 40 : 200;
  return board;
}

TEST(ImageMotionOf, AShiftIsFound) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const WaveTexture texture(seed, 60.0);
    const auto motion = estimateImageMotion(texture.render(kWidth, kHeight),
                                            texture.render(kWidth, kHeight, -21.0, 13.0), {});
    ASSERT_TRUE(motion) << seed;
    EXPECT_LT(farthest(*motion, shiftedBy(21.0, -13.0)), motion->sigma_px) << seed;
  }
}

TEST(ImageMotionOf, AFarShiftIsFoundFromAGuess) {
  const WaveTexture texture(3, 60.0);
  const auto motion =
      estimateImageMotion(texture.render(kWidth, kHeight),
                          texture.render(kWidth, kHeight, 90.0, 0.0), shiftedBy(-75.0, 8.0));
  ASSERT_TRUE(motion);
  EXPECT_LT(farthest(*motion, shiftedBy(-90.0, 0.0)), motion->sigma_px);
}

TEST(ImageMotionOf, ATurnIsFoundThroughAChangeOfExposure) {
  const cv::Mat previous = WaveTexture(4, 30.0).render(kWidth, kHeight);
  const cv::Mat warp =
      cv::getRotationMatrix2D(cv::Point2f(0.5f * kWidth, 0.5f * kHeight), 6.0, 1.0);
  cv::Mat image;
  cv::warpAffine(previous, image, warp, previous.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  image.convertTo(image, CV_8U, 0.7, 30.0);
  ImageMotion truth;
  for (int row = 0; row < 2; ++row) {
    truth.turn.row(row) << warp.at<double>(row, 0), warp.at<double>(row, 1);
    truth.shift_px[row] = warp.at<double>(row, 2);
  }
  const auto motion = estimateImageMotion(previous, image, {});
  ASSERT_TRUE(motion);
  EXPECT_LT(farthest(*motion, truth), motion->sigma_px);
}

TEST(ImageMotionOf, ASceneThatRepeatsItselfIsFoundWhereItIsOrNotAtAll) {
  int found = 0;
  for (int square = 20; square <= 40; square += 2) {
    const cv::Mat boards = checkerboard(2 * kWidth, 2 * kHeight, square);
    const int u = kWidth / 2, v = kHeight / 2;
    for (const int shift : {square / 3, square / 2, 2 * square / 3}) {
      const auto motion =
          estimateImageMotion(boards(cv::Rect(u, v, kWidth, kHeight)),
                              boards(cv::Rect(u + shift, v - shift / 2, kWidth, kHeight)),
                              shiftedBy(-shift, shift / 2));
      if (!motion) continue;
      ++found;
      EXPECT_LT(farthest(*motion, shiftedBy(-shift, shift / 2)), square) << square << ", " << shift;
    }
  }
  EXPECT_GT(found, 10);
}

TEST(ImageMotionOf, WhatCantBeComparedHasNone) {
  const cv::Mat image = WaveTexture(5, 30.0).render(kWidth, kHeight);
  const cv::Mat other = WaveTexture(6, 30.0).render(kWidth, kHeight);
  const cv::Mat black = cv::Mat::zeros(kHeight, kWidth, CV_8UC1);
  EXPECT_FALSE(estimateImageMotion(image, other, {}));
  EXPECT_FALSE(estimateImageMotion(image, black, {}));
  EXPECT_FALSE(estimateImageMotion(black, image, {}));
  EXPECT_FALSE(estimateImageMotion(image, image.colRange(0, 100), {}));
  EXPECT_FALSE(estimateImageMotion(cv::Mat(), image, {}));
}

}  // namespace
}  // namespace active_matching_slam
