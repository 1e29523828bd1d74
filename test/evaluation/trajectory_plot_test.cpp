#include "active_matching_slam/evaluation/trajectory_plot.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <opencv2/imgcodecs.hpp>

#include "active_matching_slam/evaluation/plot_canvas.h"
#include "evaluation/test_trajectories.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

/// Pixels that are clearly more red (or blue) than anything else.
int countColoured(const cv::Mat& image, int strong_channel) {
  int count = 0;
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const cv::Vec3b p = image.at<cv::Vec3b>(v, u);
      if (p[strong_channel] > p[1] + 60 && p[strong_channel] > p[2 - strong_channel] + 60) ++count;
    }
  return count;
}
constexpr int kBlue = 0, kRed = 2;

TrajectoryPlot examplePlot() {
  TrajectoryPlot plot;
  plot.estimate = randomTrajectory(200);
  plot.truth = transformed(plot.estimate, 1.0, Eigen::Matrix3d::Identity(), {0.05, 0.05, 0.05});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 100; ++i)
    plot.points.emplace_back(normal(random), normal(random), 2.0 + 0.3 * normal(random));
  plot.title = "an example";
  return plot;
}

TEST(TrajectoryPlot, ShowsEstimateAndTruthInTheirColours) {
  const cv::Mat picture = drawTrajectoryPlot(examplePlot());
  EXPECT_EQ(picture.size(), cv::Size(1600, 800));
  EXPECT_GT(countColoured(picture, kBlue), 1000);
  EXPECT_GT(countColoured(picture, kRed), 1000);
}

TEST(TrajectoryPlot, WithoutTruthNothingIsRed) {
  TrajectoryPlot plot = examplePlot();
  plot.truth.clear();
  EXPECT_EQ(countColoured(drawTrajectoryPlot(plot), kRed), 0);
}

TEST(TrajectoryPlot, IsTheSameEveryTime) {
  const cv::Mat first = drawTrajectoryPlot(examplePlot()),
                second = drawTrajectoryPlot(examplePlot());
  EXPECT_EQ(cv::norm(first, second, cv::NORM_INF), 0.0);
}

TEST(TrajectoryPlot, DrawsWhateverItIsGiven) {
  EXPECT_NO_THROW(drawTrajectoryPlot({}));
  TrajectoryPlot plot;
  plot.estimate = randomTrajectory(1);
  EXPECT_NO_THROW(drawTrajectoryPlot(plot));
  plot.points = {{1e9, -1e9, 1e9}};
  EXPECT_NO_THROW(drawTrajectoryPlot(plot));
  plot.estimate = randomTrajectory(50);
  plot.estimate[20].T_world_camera.translation() << 1e7, 0, 0;
  EXPECT_NO_THROW(drawTrajectoryPlot(plot));
}

TEST(TrajectoryPlot, IsWrittenAsPngOrTheFileIsNamed) {
  const std::string path = temporaryPath("plot.png");
  writeTrajectoryPlot(path, examplePlot());
  EXPECT_EQ(cv::imread(path).size(), cv::Size(1600, 800));
  std::remove(path.c_str());
  EXPECT_NE(faultOf([] {
              writeTrajectoryPlot("/nonexistent/p.png", examplePlot());
            }).find("/nonexistent/p.png"),
            std::string::npos);
}

TEST(RoundLength, IsOneTwoOrFiveTimesAPowerOfTen) {
  EXPECT_DOUBLE_EQ(roundLength(0.37), 0.2);
  EXPECT_DOUBLE_EQ(roundLength(1.0), 1.0);
  EXPECT_DOUBLE_EQ(roundLength(5.0), 5.0);
  EXPECT_DOUBLE_EQ(roundLength(99.0), 50.0);
}

}  // namespace
}  // namespace active_matching_slam
