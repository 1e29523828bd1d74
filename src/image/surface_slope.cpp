#include "active_matching_slam/image/surface_slope.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "sampling.h"

namespace active_matching_slam {
namespace {

constexpr double kLeastParallaxPx = 4.0;  ///< below, a slope is hardly observable
constexpr double kGreySigma = 2.0;        ///< of image and template together [grey levels]
/// Weight of an image's information: errors of successive images, taken from nearly the same place,
/// are correlated.
constexpr double kInformationWeight = 0.33;
constexpr double kPriorTangent = 0.9;  ///< sigma, before anything is learnt
constexpr double kSteepestTangent = 3.0;

/// t ~ x0 I + x1 I_u + x2 I_v + x3 + (x4, x5) s g over the template, with the image's gradient
/// (I_u, I_v), g its part along the parallax, and s the place in the source patch.
constexpr int kUnknowns = 6;
constexpr int kMostPixels = Template::kMaximumSize * Template::kMaximumSize;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, kUnknowns, Eigen::ColMajor, kMostPixels>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Right = Eigen::Matrix<double, kUnknowns, 1>;

}  // namespace

bool learnSlope(const cv::Mat& image, const Eigen::Vector2d& pixel, const Template& expected,
                const PatchView& view, SourcePatch* patch) {
  const int size = expected.size, half = size / 2;
  if (!(view.parallax_px.norm() >= kLeastParallaxPx) || size < 3 || expected.energy <= 0)
    return false;
  SampledWindow window;
  if (!window.sample(image, pixel, size)) return false;

  const SourceOffset source_offset(view);
  const double mean = static_cast<double>(expected.sum) / (size * size);
  Rows rows(size * size, kUnknowns);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostPixels, 1> wanted(size * size);
  for (int j = 0, row = 0; j < size; ++j) {
    const float* at = window.row(j);
    for (int i = 0; i < size; ++i, ++row) {
      const double slope_u = 0.5 * (at[i + 1] - at[i - 1]);
      const double slope_v =
          0.5 * (at[i + SampledWindow::kStride] - at[i - SampledWindow::kStride]);
      const double along = slope_u * view.parallax_px.x() + slope_v * view.parallax_px.y();
      const Eigen::Vector2d source = source_offset(i - half, j - half);
      rows.row(row) << at[i] - mean, slope_u, slope_v, 1.0, along * source.x(), along * source.y();
      wanted[row] = expected.at(j, i) - mean;
    }
  }
  const Normal normal = rows.transpose().lazyProduct(rows);
  const Right right = rows.transpose().lazyProduct(wanted);

  // Schur complement: the information about the slope with place, gain and offset eliminated.
  const Eigen::LDLT<Eigen::Matrix4d> rest(normal.topLeftCorner<4, 4>());
  const Eigen::Vector4d pivots = rest.vectorD();
  if (!(pivots.minCoeff() > 1e-6 * pivots.maxCoeff())) return false;
  const Eigen::Matrix<double, 4, 2> eliminated = rest.solve(normal.topRightCorner<4, 2>());
  const double gain = rest.solve(right.head<4>())[0];
  if (!(gain > 0.05)) return false;  // inverted or vanished contrast
  const double weight = kInformationWeight / (kGreySigma * kGreySigma);
  const Eigen::Matrix2d fresh =
      weight * gain * gain *
      (normal.bottomRightCorner<2, 2>() - normal.bottomLeftCorner<2, 4>() * eliminated);
  const Eigen::Vector2d gradient =
      weight * gain * (right.tail<2>() - eliminated.transpose() * right.head<4>());

  Eigen::Matrix2d information = patch->slope_information_px2;
  if (information.isZero(0.0))
    information = view.tangent_metric_px2 / (kPriorTangent * kPriorTangent);
  information += fresh;
  const Eigen::Vector2d slope = patch->slope_per_px + information.ldlt().solve(gradient);
  const double tangent2 = slope.dot(view.tangent_metric_px2 * slope);
  if (!information.allFinite() || !(tangent2 <= kSteepestTangent * kSteepestTangent)) return false;
  patch->slope_per_px = slope;
  patch->slope_information_px2 = 0.5 * (information + information.transpose());
  return true;
}

}  // namespace active_matching_slam
