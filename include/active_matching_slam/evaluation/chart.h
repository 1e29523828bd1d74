#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {

/// One line of a chart. Points that are not finite (or not positive on a logarithmic axis) are left
/// out.
struct ChartSeries {
  std::string name;
  std::vector<Eigen::Vector2d> points;  ///< joined in this order
};

struct LineChart {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  bool equal_axes = false;  ///< the same scale on both axes, for maps and images
  bool y_down = false;      ///< y grows downwards, for images
  bool markers = true;
  std::vector<ChartSeries> series{};
};

/// One stacked bar.
struct ChartBar {
  std::string name;
  std::vector<double> values;  ///< one a part, >= 0; what is not finite counts as 0
};

struct BarChart {
  std::string title, x_label, y_label;
  std::vector<std::string> parts{};  ///< names of the parts, the lowest first
  std::vector<ChartBar> bars{};    ///< from left to right
};

/// Pictures with axes, ticks, grid and legend, 8-bit BGR. Empty charts draw as empty axes.
cv::Mat drawLineChart(const LineChart& chart, int width_px = 720, int height_px = 480);
cv::Mat drawBarChart(const BarChart& chart, int width_px = 720, int height_px = 480);

/// Pictures beside and below each other on white, row by row, `columns` (>= 1) in a row.
cv::Mat tilePictures(const std::vector<cv::Mat>& pictures, int columns);

/// Writes a picture. Throws std::runtime_error naming the file.
void writePicture(const std::string& path, const cv::Mat& picture);

}  // namespace active_matching_slam
