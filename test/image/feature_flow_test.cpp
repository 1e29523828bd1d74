#include "active_matching_slam/image/feature_flow.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

/// Grey blobs of some pixels, and of some tens of pixels, of a plane larger than an image.
cv::Mat blobs(unsigned seed) {
  cv::Mat sum = cv::Mat::zeros(700, 900, CV_32F);
  cv::RNG random(seed);
  for (const double size : {2.0, 6.0, 18.0, 54.0}) {
    cv::Mat noise(sum.size(), CV_32F);
    random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(noise, noise, cv::Size(), size);
    cv::Scalar mean, deviation;
    cv::meanStdDev(noise, mean, deviation);
    sum += noise / deviation[0];
  }
  cv::Mat image;
  sum.convertTo(image, CV_8U, 30.0, 128.0);
  return image;
}

TEST(FeatureFlow, FindsPointsAfterALargeShiftAndGivesUpThoseThatLeft) {
  constexpr int kWide = 640, kHigh = 480;
  const cv::Mat plane = blobs(3);
  const Eigen::Vector2d shift(37.0, -21.0);
  const cv::Mat before = plane(cv::Rect(100, 100, kWide, kHigh)).clone();
  const cv::Mat now = plane(cv::Rect(100 - 37, 100 + 21, kWide, kHigh)).clone();
  std::vector<std::optional<Eigen::Vector2d>> points;
  for (int v = 40; v < kHigh; v += 80)
    for (int u = 40; u < kWide; u += 80) points.emplace_back(Eigen::Vector2d(u, v));
  points.emplace_back(std::nullopt);
  const auto found = trackPoints(before, now, points);
  ASSERT_EQ(found.size(), points.size());
  EXPECT_FALSE(found.back());
  int inside = 0, tracked = 0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const Eigen::Vector2d expected = *points[i] + shift;
    const bool stays = expected.x() < kWide - 20.0 && expected.y() > 20.0;
    const bool leaves = expected.x() > kWide || expected.y() < 0.0;
    inside += stays;
    if (leaves) {
      EXPECT_FALSE(found[i]) << points[i]->transpose();
    } else if (stays && found[i]) {
      ++tracked;
      EXPECT_LT((*found[i] - expected).norm(), flowSigma_px(kWide));
    }
  }
  EXPECT_GT(tracked, 0.9 * inside);
}

TEST(FeatureFlow, FindsNothingInAnotherPicture) {
  const cv::Mat before = blobs(1)(cv::Rect(0, 0, 320, 240)).clone();
  const cv::Mat now = blobs(2)(cv::Rect(0, 0, 320, 240)).clone();
  std::vector<std::optional<Eigen::Vector2d>> points;
  for (int u = 30; u < 300; u += 15) points.emplace_back(Eigen::Vector2d(u, 120.0));
  int found = 0;
  for (const auto& point : trackPoints(before, now, points)) found += point.has_value();
  EXPECT_LE(found, 3) << "of 18";
}

}  // namespace
}  // namespace active_matching_slam
