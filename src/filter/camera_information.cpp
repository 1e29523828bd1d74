#include "active_matching_slam/filter/camera_information.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {
namespace {

/// Added to the camera's correlation matrix, which is singular right after the pose was known.
/// Derivation: above the rounding errors of its factorisation, 12 times 2^-52, by far; far below
/// what any correlation is known to.
constexpr double kRegularisation = 1e-9;

constexpr int kMotion = CameraError::kMotionSize;
using MotionVector = Eigen::Matrix<double, kMotion, 1>;

}  // namespace

std::vector<std::optional<CameraMeasurement>> measurementsOfCamera(
    const Ekf& filter, const CameraModel& camera, const std::vector<FeatureId>& ids,
    const std::vector<double>& sigmas_px) {
  std::vector<std::optional<CameraMeasurement>> measurements(ids.size());
  const auto P = filter.covariance();
  const CameraModel lens = camera.corrected(filter.camera().lens);
  MotionCovariance correlation = P.topLeftCorner<kMotion, kMotion>();
  const MotionVector sigma = correlation.diagonal().cwiseMax(0.0).cwiseSqrt();
  const MotionVector scale = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  correlation = (scale.asDiagonal() * correlation * scale.asDiagonal()).eval();
  for (int i = 0; i < kMotion; ++i)
    correlation(i, i) = scale[i] > 0.0 ? correlation(i, i) + kRegularisation : 1.0;
  const Eigen::LLT<MotionCovariance> camera_factor(correlation);
  if (camera_factor.info() != Eigen::Success) return measurements;
  constexpr int kCamera = CameraError::kSize;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState* feature = filter.find(ids[i]);
    if (!feature) continue;
    const auto projection = projectFeature(lens, filter.camera(), *feature);
    if (!projection) continue;
    const int size = feature->size(), at = feature->offset;
    const auto H_f = projection->d_feature.leftCols(size);
    // P H^T, for the rows of the camera and of the feature.
    const Eigen::Matrix<double, kCamera, 2> of_camera =
        P.topLeftCorner<kCamera, kCamera>() * projection->d_camera.transpose() +
        P.block(0, at, kCamera, size) * H_f.transpose();
    const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, 6, 2> of_feature =
        P.block(at, 0, size, kCamera) * projection->d_camera.transpose() +
        P.block(at, at, size, size) * H_f.transpose();
    const Eigen::Matrix<double, kMotion, 2> whitened =
        camera_factor.matrixL().solve((scale.asDiagonal() * of_camera.topRows<kMotion>()).eval());
    const double variance = sigmas_px[i] * sigmas_px[i];
    const Eigen::Matrix2d S = projection->d_camera * of_camera + H_f * of_feature +
                              variance * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d given_camera = S - whitened.transpose() * whitened;
    const Eigen::LLT<Eigen::Matrix2d> noise(given_camera);
    if (noise.info() != Eigen::Success) continue;
    const double own_bits =
        0.5 * std::log2(std::max(given_camera.determinant() / (variance * variance), 1.0));
    const double area_px2 = 9.0 * M_PI * std::sqrt(std::max(S.determinant(), 0.0));
    measurements[i] = {noise.matrixL().solve(whitened.transpose()), own_bits, area_px2};
  }
  return measurements;
}

}  // namespace active_matching_slam
