#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

/// Samples that an interpolated value is made of, a side, and how many of them lie before the one
/// that it follows.
constexpr int kTaps = 8, kTapsBefore = 3;

/// Weights of the samples at -3, ..., 4 for a position `x` in [0, 1]: a sinc under Kaiser's window
/// (Kaiser & Schafer 1980), tabulated. Waves of 3.3 pixels and more are moved right to .004 px;
/// the polynomial through as many samples moves them by up to .013 px less than asked, all features
/// that move alike to the same side.
void interpolationWeights(double x, float weights[kTaps]);

/// An image around a sub-pixel place, on the grid of a template and a rim of one for central
/// differences.
class SampledWindow {
 public:
  /// Rows are padded to this many numbers, so that loops along them vectorise.
  static constexpr int kStride = 40;

  /// Interpolates a window for a template of side `size` around `centre`; false when its support
  /// leaves the image, `centre` is not finite, or the image is not 8-bit grey.
  bool sample(const cv::Mat& image, const Eigen::Vector2d& centre, int size) {
    if (image.type() != CV_8UC1 || !centre.allFinite() || centre.cwiseAbs().maxCoeff() > 1e6)
      return false;
    const int side = size + 2, support = side + kTaps - 1;
    const double u = centre.x() - side / 2, v = centre.y() - side / 2;
    const int at_u = static_cast<int>(std::floor(u)), at_v = static_cast<int>(std::floor(v));
    const int first_u = at_u - kTapsBefore, first_v = at_v - kTapsBefore;
    if (first_u < 0 || first_v < 0 || first_u + support > image.cols ||
        first_v + support > image.rows)
      return false;
    // The fractional shift is the same everywhere, so it is separable.
    float a[kTaps], b[kTaps];
    interpolationWeights(u - at_u, a);
    interpolationWeights(v - at_v, b);
    std::array<float, (kLargestSide + kTaps - 1) * kStride> along;
    for (int j = 0; j < support; ++j) {
      const std::uint8_t* grey = image.ptr<std::uint8_t>(first_v + j) + first_u;
      float* to = &along[j * kStride];
      for (int i = 0; i < side; ++i)
        to[i] = a[0] * grey[i] + a[1] * grey[i + 1] + a[2] * grey[i + 2] + a[3] * grey[i + 3] +
                a[4] * grey[i + 4] + a[5] * grey[i + 5] + a[6] * grey[i + 6] + a[7] * grey[i + 7];
    }
    for (int j = 0; j < side; ++j) {
      const float* from = &along[j * kStride];
      float* to = &values_[j * kStride];
      for (int i = 0; i < side; ++i)
        to[i] = b[0] * from[i] + b[1] * from[i + kStride] + b[2] * from[i + 2 * kStride] +
                b[3] * from[i + 3 * kStride] + b[4] * from[i + 4 * kStride] +
                b[5] * from[i + 5 * kStride] + b[6] * from[i + 6 * kStride] +
                b[7] * from[i + 7 * kStride];
    }
    return true;
  }

  /// The template's row `j`, from its first column on; `-1` and `kStride` address its neighbours.
  const float* row(int j) const { return &values_[(j + 1) * kStride + 1]; }

 private:
  static constexpr int kLargestSide = Template::kMaximumSize + 2;
  static_assert(kStride >= kLargestSide, "a row holds the template and a rim");

  std::array<float, kLargestSide * kStride> values_{};
};

}  // namespace active_matching_slam
