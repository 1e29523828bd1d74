#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "active_matching_slam/camera/camera_calibration.h"

namespace active_matching_slam {

/// The size at which a camera's images are tracked: their own, or a smaller one of about the same
/// proportions where they have more pixels than an image of 4:3 that is `working_width` wide.
class WorkingSize {
 public:
  WorkingSize(const CameraCalibration& given, int working_width);

  /// Of the images given.
  int givenWidth() const { return given_.width; }
  int givenHeight() const { return given_.height; }
  bool isReduced() const { return size_.width != given_.width || size_.height != given_.height; }
  /// Of the images tracked.
  const CameraCalibration& calibration() const { return working_; }

  /// Halves, means of four pixels each, and what is left by interpolation. Shares the image's memory where its size is kept.
  cv::Mat reduce(const cv::Mat& image) const;
  /// Where a pixel of an image given lies in the reduced one: centres are whole numbers, so that
  /// the edge of either is at -0.5.
  Eigen::Vector2d reduce(const Eigen::Vector2d& pixel) const;
  /// Length in the reduced image of a pixel of one given.
  double scale() const;

 private:
  CameraCalibration given_, working_;
  cv::Size size_;
};

}  // namespace active_matching_slam
