#include "active_matching_slam/evaluation/chart.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

namespace active_matching_slam {
namespace {

/// Pixels of strong colour: what was drawn beside axes and text.
int colouredPixels(const cv::Mat& picture) {
  int count = 0;
  for (int v = 0; v < picture.rows; ++v)
    for (int u = 0; u < picture.cols; ++u) {
      const cv::Vec3b& p = picture.at<cv::Vec3b>(v, u);
      const auto [low, high] = std::minmax({p[0], p[1], p[2]});
      count += high - low > 60;
    }
  return count;
}

LineChart chartOf(const std::vector<Eigen::Vector2d>& points) {
  LineChart chart;
  chart.series.push_back({"", points});
  return chart;
}

TEST(Chart, DrawsALineFromLowerLeftToUpperRight) {
  LineChart chart = chartOf({{0.0, 0.0}, {1.0, 1.0}});
  chart.series[0].name = "";
  const cv::Mat picture = drawLineChart(chart, 400, 300);
  ASSERT_EQ(picture.size(), cv::Size(400, 300));
  EXPECT_GT(colouredPixels(picture(cv::Rect(70, 150, 165, 100))), 50);
  EXPECT_LT(colouredPixels(picture(cv::Rect(80, 50, 120, 60))), 20);
}

TEST(Chart, LeavesOutWhatCanNotBeShown) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  LineChart clean = chartOf({{1.0, 10.0}, {10.0, 100.0}});
  LineChart dirty =
      chartOf({{1.0, 10.0}, {nan, 3.0}, {2.0, nan}, {0.0, 5.0}, {5.0, -1.0}, {10.0, 100.0}});
  clean.log_x = clean.log_y = dirty.log_x = dirty.log_y = true;
  const cv::Mat difference = drawLineChart(clean) != drawLineChart(dirty);
  EXPECT_EQ(cv::countNonZero(difference.reshape(1)), 0);
}

TEST(Chart, EmptyChartsAndEqualValuesDraw) {
  EXPECT_FALSE(drawLineChart(LineChart()).empty());
  EXPECT_FALSE(drawBarChart(BarChart()).empty());
  EXPECT_FALSE(drawLineChart(chartOf({{1.0, 2.0}, {1.0, 2.0}})).empty());
}

TEST(Chart, EqualAxesMakeASquareSquare) {
  LineChart chart = chartOf({{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}, {0.0, 0.0}});
  chart.equal_axes = true;
  chart.markers = false;
  const cv::Mat picture = drawLineChart(chart, 600, 300);
  cv::Mat drawn(picture.size(), CV_8UC1, cv::Scalar(0));
  for (int v = 50; v < 240; ++v)
    for (int u = 80; u < 520; ++u) {
      const cv::Vec3b& p = picture.at<cv::Vec3b>(v, u);
      drawn.at<uchar>(v, u) = p[0] - p[2] > 60 ? 255 : 0;
    }
  const cv::Rect box = cv::boundingRect(drawn);
  EXPECT_NEAR(box.width, box.height, 3);
}

TEST(Chart, BarsStackTheirParts) {
  BarChart chart;
  chart.parts = {"", ""};
  chart.bars = {{"low", {1.0, 0.0}}, {"high", {1.0, 3.0}}};
  const cv::Mat picture = drawBarChart(chart, 400, 300);
  std::vector<int> heights;  // of what is drawn beside axes and text: a value a bar
  bool is_in_bar = false;
  for (int u = 0; u < picture.cols; ++u) {
    const int height = colouredPixels(picture.col(u));
    if (height > 0 && !is_in_bar) heights.push_back(height);
    is_in_bar = height > 0;
  }
  ASSERT_EQ(heights.size(), 2u);
  EXPECT_NEAR(heights[1], 4 * heights[0], 8);
}

TEST(Chart, TilesFillRowsFirst) {
  const cv::Mat red(10, 20, CV_8UC3, cv::Scalar(0, 0, 255));
  const cv::Mat tiled = tilePictures({red, red, red}, 2);
  EXPECT_EQ(tiled.size(), cv::Size(40, 20));
  EXPECT_EQ(tiled.at<cv::Vec3b>(15, 5), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(tiled.at<cv::Vec3b>(15, 25), cv::Vec3b(255, 255, 255));
  EXPECT_THROW(tilePictures({red}, 0), std::invalid_argument);
}

TEST(Chart, AFileThatCanNotBeWrittenIsNamed) {
  try {
    writePicture("/nonexistent/x.png", cv::Mat(2, 2, CV_8UC3, cv::Scalar::all(0)));
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/nonexistent/x.png"), std::string::npos);
  }
}

}  // namespace
}  // namespace active_matching_slam
