#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/image_mask.h"

namespace active_matching_slam {

/// Image points with ORB descriptors.
struct DescribedPoints {
  std::vector<Eigen::Vector2d> pixels;
  cv::Mat descriptors;  ///< a row of 32 bytes for each
};

/// Corners of an 8-bit grey image at scales from enlarged to half, the largest first, of the part
/// of it that is used: found in bands of rows, each of which takes a bounded time.
class CornerScan {
 public:
  explicit CornerScan(const cv::Mat& image, const ImageMask& mask = {});

  bool isDone() const;
  /// Pixels of the next band, at its scale.
  double nextPixels() const;
  void step();
  const DescribedPoints& points() const { return points_; }

 private:
  void beginScale();
  cv::Range band() const;

  cv::Mat image_, scaled_;
  ImageMask mask_;
  std::size_t scale_ = 0;
  int band_ = 0, bands_ = 0;
  DescribedPoints points_;
};

/// Descriptor (1 x 32) at a point of a small image, by the same rules; empty when it has none.
cv::Mat describePoint(const cv::Mat& image, const Eigen::Vector2d& point);

}  // namespace active_matching_slam
