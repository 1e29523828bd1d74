#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {

/// Semi-axes [px] of a 3-sigma ellipse, longer first: 3 times the roots of the eigenvalues; and the
/// direction of the longer one, from u towards v [deg].
struct EllipseAxes {
  double major_px = 0.0, minor_px = 0.0, angle_deg = 0.0;
};
EllipseAxes threeSigmaEllipse(const Eigen::Matrix2d& covariance_px2);

/// A picture to draw into, 8-bit BGR, in pixel coordinates of the original image. Small images are
/// enlarged by a whole factor. Lines, marks and text are sized in units of 1/640 of the picture's
/// width: a viewer fits the picture into its window, and they must be readable there.
class DebugCanvas {
 public:
  explicit DebugCanvas(const cv::Mat& gray);

  /// 3 sigma.
  void ellipse(const Eigen::Vector2d& center, const Eigen::Matrix2d& covariance_px2,
               const cv::Scalar& color);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& color,
            double width = 1.0);
  void dot(const Eigen::Vector2d& center, double radius, const cv::Scalar& color);
  void cross(const Eigen::Vector2d& center, double radius, const cv::Scalar& color);
  void diamond(const Eigen::Vector2d& center, double radius, const cv::Scalar& color);
  /// Above and to the right of `position`, with a dark edge.
  void label(const Eigen::Vector2d& position, const std::string& text, const cv::Scalar& color);

  double unit() const { return unit_; }
  cv::Mat& image() { return image_; }

 private:
  cv::Point at(const Eigen::Vector2d& pixel) const;
  int thickness(double width) const;
  /// From the mark's size to a distance in the original image.
  double inPixels(double size) const { return size * unit_ / scale_; }

  int scale_;
  double unit_ = 1.0;
  cv::Mat image_;
};

/// One mark of a picture and what it means.
struct LegendEntry {
  enum class Symbol { kNone, kEllipse, kDot, kCross, kDiamond, kLine };
  Symbol symbol;
  std::function<cv::Scalar(double)> color;  ///< of 0 to 1: a symbol has several where it varies
  std::string text;
};

/// The picture with lines of text below it, where they hide nothing: `status` (unless it is empty),
/// and the legend. Its size depends on the picture's, on whether there is a status, and on the
/// legend.
cv::Mat withFooter(const cv::Mat& picture, double unit, const std::string& status,
                   const cv::Scalar& status_color, const std::vector<LegendEntry>& legend);

}  // namespace active_matching_slam
