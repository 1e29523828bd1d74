#include "active_matching_slam/image/feature_flow.h"

#include <gtest/gtest.h>

#include "textures.h"

namespace active_matching_slam {
namespace {

TEST(FeatureFlow, FindsPointsAfterALargeShiftAndGivesUpThoseThatLeft) {
  constexpr int kWide = 640, kHigh = 480;
  const WaveTexture texture(3, 12.0);
  const Eigen::Vector2d shift(57.0, -31.0);
  const cv::Mat before = texture.render(kWide, kHigh);
  const cv::Mat now = texture.render(kWide, kHigh, -shift.x(), -shift.y());
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
  const cv::Mat before = WaveTexture(1, 12.0).render(320, 240);
  const cv::Mat now = WaveTexture(2, 12.0).render(320, 240);
  std::vector<std::optional<Eigen::Vector2d>> points;
  for (int u = 30; u < 300; u += 15) points.emplace_back(Eigen::Vector2d(u, 120.0));
  int found = 0;
  for (const auto& point : trackPoints(before, now, points)) found += point.has_value();
  EXPECT_LE(found, 3) << "of 18";
}

}  // namespace
}  // namespace active_matching_slam
