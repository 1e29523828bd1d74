#pragma once

#include <opencv2/core.hpp>

namespace active_matching_slam {

/// Cheap measures of what an image is worth to a tracker.
struct ImageQuality {
  double mean = 0.0;       ///< [grey levels]
  double contrast = 0.0;   ///< standard deviation [grey levels]
  double sharpness = 0.0;  ///< mean absolute difference of horizontal neighbours [grey levels]
  /// Covered lens, black or saturated frame: nothing to track.
  bool isBlank() const { return contrast < 2.0; }
};

/// Of an 8-bit grey image, on every fourth row. Zeros for an empty one.
ImageQuality measureImageQuality(const cv::Mat& image);

/// Mean absolute difference of two 8-bit grey images [grey levels]; infinity when sizes differ.
double meanAbsoluteDifference(const cv::Mat& a, const cv::Mat& b);

/// True when `image` repeats `previous` (the driver sent the same frame again): not a pixel
/// differs.
bool isRepeatedImage(const cv::Mat& image, const cv::Mat& previous);

}  // namespace active_matching_slam
