#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {

/// Text in the style of all plots; `origin` is the left end of its base line.
void putPlotText(cv::Mat* image, const std::string& text, cv::Point origin, double size);
int plotTextWidth(const std::string& text, double size);

/// 1, 2 or 5 times a power of ten: the largest that is at most `length` > 0.
double roundLength(double length);

/// A panel of a picture in plot coordinates: x to the right, y upwards, the same scale on both
/// axes. What lies outside the panel is not drawn.
class PlotCanvas {
 public:
  /// `image`: 8-bit BGR, outlives the canvas.
  PlotCanvas(cv::Mat* image, const cv::Rect& panel, const Eigen::Vector2d& center,
             double pixels_per_unit);

  /// Grid with its numbers along the left and lower edge.
  void drawGrid(const std::string& x_label, const std::string& y_label, const std::string& title);
  void drawFrame();
  void drawScaleBar(const std::string& unit);

  void polyline(const std::vector<Eigen::Vector2d>& line, const cv::Scalar& colour, int thickness);
  void dot(const Eigen::Vector2d& position, double radius_px, const cv::Scalar& colour);
  void ring(const Eigen::Vector2d& position, double radius_px, const cv::Scalar& colour);
  void square(const Eigen::Vector2d& position, double half_px, const cv::Scalar& colour);

 private:
  /// Pixel within the panel, in the fixed-point format of OpenCV's drawing functions.
  cv::Point fixedPoint(const Eigen::Vector2d& position) const;
  Eigen::Vector2d pixel(const Eigen::Vector2d& position) const;

  cv::Mat image_;  ///< header on the caller's picture
  cv::Mat panel_;  ///< the part drawn into
  cv::Rect rect_;
  Eigen::Vector2d center_;
  double pixels_per_unit_;
};

}  // namespace active_matching_slam
