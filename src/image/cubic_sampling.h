#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

/// Weights of the four samples at -1, 0, 1, 2 for a position `x` in [0, 1]: cubic convolution with
/// a = -1/2 (Keys 1981), exact for parabolas.
template <typename Real>
void cubicWeights(double x, Real weights[4]) {
  weights[0] = static_cast<Real>(((-0.5 * x + 1.0) * x - 0.5) * x);
  weights[1] = static_cast<Real>((1.5 * x - 2.5) * x * x + 1.0);
  weights[2] = static_cast<Real>(((-1.5 * x + 2.0) * x + 0.5) * x);
  weights[3] = static_cast<Real>((0.5 * x - 0.5) * x * x);
}

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
    const int side = size + 2;
    const double u = centre.x() - side / 2, v = centre.y() - side / 2;
    const int first_u = static_cast<int>(std::floor(u)), first_v = static_cast<int>(std::floor(v));
    if (first_u < 1 || first_v < 1 || first_u + side + 1 >= image.cols ||
        first_v + side + 1 >= image.rows)
      return false;
    // The fractional shift is the same everywhere, so it is separable.
    float a[4], b[4];
    cubicWeights(u - first_u, a);
    cubicWeights(v - first_v, b);
    std::array<float, (kLargestSide + 3) * kStride> along;
    for (int j = 0; j < side + 3; ++j) {
      const std::uint8_t* grey = image.ptr<std::uint8_t>(first_v - 1 + j) + first_u - 1;
      float* to = &along[j * kStride];
      for (int i = 0; i < side; ++i)
        to[i] = a[0] * grey[i] + a[1] * grey[i + 1] + a[2] * grey[i + 2] + a[3] * grey[i + 3];
    }
    for (int j = 0; j < side; ++j) {
      const float *r0 = &along[j * kStride], *r1 = r0 + kStride, *r2 = r1 + kStride;
      const float* r3 = r2 + kStride;
      float* to = &values_[j * kStride];
      for (int i = 0; i < side; ++i)
        to[i] = b[0] * r0[i] + b[1] * r1[i] + b[2] * r2[i] + b[3] * r3[i];
    }
    return true;
  }

  /// The template's row `j`, from its first column on; `-1` and `kStride` lead to its neighbours.
  const float* row(int j) const { return &values_[(j + 1) * kStride + 1]; }

 private:
  static constexpr int kLargestSide = Template::kMaximumSize + 2;
  static_assert(kStride >= kLargestSide, "a row holds the template and a rim");

  std::array<float, kLargestSide * kStride> values_{};
};

}  // namespace active_matching_slam
