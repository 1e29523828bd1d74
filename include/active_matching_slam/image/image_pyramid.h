#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

/// Copies of an image, each smoothed and half as large as the one before (Burt and Adelson 1983),
/// made when first asked for. Pixel (u, v) of level l shows what lies around (2^l u, 2^l v).
class ImagePyramid {
 public:
  /// Levels have a border of so many pixels, which repeat the outermost: templates fit everywhere.
  static constexpr int kBorder = Template::kMaximumSize / 2;

  /// Starts anew with an 8-bit grey image, shared.
  void begin(const cv::Mat& image);
  /// The copy of the level (0: the image itself, copied) with its border.
  const cv::Mat& bordered(int level);

 private:
  std::vector<cv::Mat> levels_, bordered_;
};

}  // namespace active_matching_slam
