#include "active_matching_slam/image/subpixel.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "sampling.h"

namespace active_matching_slam {
namespace {

constexpr int kStride = SampledWindow::kStride;

int roundedUp(int count) { return (count + 7) / 8 * 8; }

/// Shrinkage of the covariance of a fit towards an isotropic one: least squares assume that the
/// template differs from the image by noise alone.
constexpr double kShrinkage = 0.25;

constexpr int kSums = 13;

/// The sums that make the normal equations, over the template: of grey level I, slopes I_u and I_v,
/// 1 and t, products as named in NormalEquations. They run along columns first: a fixed order, and
/// many at a time. Columns beyond the template run along and are left out at the end.
__attribute__((target_clones("avx2", "default"))) void sumProducts(const SampledWindow& window,
                                                                   const float* wanted, int size,
                                                                   float mean, double* s) {
  const int lanes = roundedUp(size);
  float sums[kSums][kStride] = {};
  for (int j = 0; j < size; ++j) {
    const float* at = window.row(j);
    const float* t = wanted + j * kStride;
    for (int i = 0; i < lanes; ++i) {
      const float grey = at[i] - mean;
      const float slope_u = 0.5f * (at[i + 1] - at[i - 1]);
      const float slope_v = 0.5f * (at[i + kStride] - at[i - kStride]);
      sums[0][i] += grey * grey;
      sums[1][i] += grey * slope_u;
      sums[2][i] += grey * slope_v;
      sums[3][i] += grey;
      sums[4][i] += slope_u * slope_u;
      sums[5][i] += slope_u * slope_v;
      sums[6][i] += slope_u;
      sums[7][i] += slope_v * slope_v;
      sums[8][i] += slope_v;
      sums[9][i] += grey * t[i];
      sums[10][i] += slope_u * t[i];
      sums[11][i] += slope_v * t[i];
      sums[12][i] += t[i];
    }
  }
  for (int k = 0; k < kSums; ++k) {
    s[k] = 0.0;
    for (int i = 0; i < size; ++i) s[k] += sums[k][i];
  }
}

/// Normal equations of t ~ x0 I + x1 I_u + x2 I_v + x3 over the template. Grey levels are given
/// less `mean`.
class NormalEquations {
 public:
  NormalEquations(const SampledWindow& window, const float* wanted, int size, float mean) {
    double s[kSums];
    sumProducts(window, wanted, size, mean, s);
    left_ << s[0], s[1], s[2], s[3], s[1], s[4], s[5], s[6], s[2], s[5], s[7], s[8], s[3], s[6],
        s[8], size * size;
    right_ << s[9], s[10], s[11], s[12];
    pixels_ = size * size;
  }

  /// Empty when they are singular: nothing there, or an edge that slides along itself.
  std::optional<Eigen::Vector4d> solve() const {
    const Eigen::LDLT<Eigen::Matrix4d> solver(left_);
    const Eigen::Vector4d pivots = solver.vectorD();
    if (!(pivots.minCoeff() > 1e-6 * pivots.maxCoeff())) return std::nullopt;
    return solver.solve(right_);
  }

  /// The fit at `pixel`, with the solution x there and for a template of variance `variance`.
  TemplateFit fit(const Eigen::Vector2d& pixel, const Eigen::Vector4d& x, double variance) const {
    const double left_over = std::max(0.0, pixels_ * variance - x.dot(right_)) / (pixels_ - 4);
    const Eigen::Matrix2d shape = left_.inverse().block<2, 2>(1, 1);
    const double mean = 0.5 * shape.trace();
    return {pixel, std::sqrt(left_over * mean) / x[0],
            (1.0 - kShrinkage) / mean * shape + kShrinkage * Eigen::Matrix2d::Identity()};
  }

 private:
  Eigen::Matrix4d left_;
  Eigen::Vector4d right_;
  int pixels_ = 0;
};

}  // namespace

Eigen::Vector2d paraboloidPeak(const float s[9]) {
  // Least squares on the 3 x 3 grid of f = a + b u + c v + d u^2 + e u v + g v^2.
  const double left = double(s[0]) + s[3] + s[6], right = double(s[2]) + s[5] + s[8];
  const double top = double(s[0]) + s[1] + s[2], bottom = double(s[6]) + s[7] + s[8];
  const double middle_u = double(s[1]) + s[4] + s[7], middle_v = double(s[3]) + s[4] + s[5];
  const double b = (right - left) / 6.0, c = (bottom - top) / 6.0;
  const double d = (left + right - 2.0 * middle_u) / 6.0;
  const double g = (top + bottom - 2.0 * middle_v) / 6.0;
  const double e = (double(s[0]) + s[8] - s[2] - s[6]) / 4.0;
  const double determinant = 4.0 * d * g - e * e;
  if (!(determinant > 1e-12) || !(d < 0.0)) return Eigen::Vector2d::Zero();
  return {std::clamp((e * c - 2.0 * g * b) / determinant, -0.5, 0.5),
          std::clamp((e * b - 2.0 * d * c) / determinant, -0.5, 0.5)};
}

std::optional<TemplateFit> refineSubpixel(const cv::Mat& image, const Template& patch,
                                          const Eigen::Vector2d& start) {
  constexpr int kIterations = 20;
  // The error left after a step is a fraction of it.
  constexpr double kConverged = 0.001, kLargestMove = 1.0;
  const int size = patch.size;
  if (size < 3 || patch.energy <= 0) return std::nullopt;

  const float mean = static_cast<float>(patch.sum) / static_cast<float>(size * size);
  std::array<float, Template::kMaximumSize * kStride> wanted;
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < kStride; ++i)
      wanted[j * kStride + i] = i < size ? patch.at(j, i) - mean : 0;

  // t ~ gain (I + I_u du + I_v dv) + offset is linear in (gain, gain du, gain dv, offset). The
  // image explains the template and not the other way round: then the residual is the template's
  // own energy times 1 - ZNCC^2, and the least is where the ZNCC is highest, blurred image or not.
  Eigen::Vector2d pixel = start;
  SampledWindow window;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    if (!window.sample(image, pixel, size)) return std::nullopt;
    const NormalEquations equations(window, wanted.data(), size, mean);
    const std::optional<Eigen::Vector4d> x = equations.solve();
    if (!x || !((*x)[0] > 0.05)) return std::nullopt;  // inverted or vanished contrast
    const Eigen::Vector2d step = x->segment<2>(1) / (*x)[0];
    pixel += step;
    if (!((pixel - start).norm() <= kLargestMove)) return std::nullopt;
    if (step.norm() < kConverged)
      return equations.fit(pixel, *x, patch.contrast() * patch.contrast());
  }
  return std::nullopt;
}

}  // namespace active_matching_slam
