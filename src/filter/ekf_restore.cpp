#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {
namespace {

/// Of lengths and angles that must be one or right. Derivation: rounding leaves 1e-15.
constexpr double kUnitTolerance = 1e-6;
/// Derivation: correlations may exceed one by rounding only, which for all but certain rows is
/// measured by the larger variance.
constexpr double kCorrelationTolerance = 1e-3, kRounding = 1e-9;

[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument("filter state: " + what);
}

bool isUnit(const Eigen::Vector3d& v) { return std::abs(v.norm() - 1.0) <= kUnitTolerance; }

void checkCamera(const CameraState& camera) {
  if (!camera.position_world.allFinite() || !camera.velocity_world.allFinite() ||
      !camera.angular_velocity_camera.allFinite() || !camera.q_world_camera.coeffs().allFinite() ||
      !std::isfinite(camera.readout_s) || !std::isfinite(camera.lens.focal) ||
      !std::isfinite(camera.lens.radial) || !camera.lens.centre.allFinite())
    refuse("the camera is not finite");
  if (std::abs(camera.q_world_camera.norm() - 1.0) > kUnitTolerance)
    refuse("the camera's quaternion has length " + std::to_string(camera.q_world_camera.norm()) +
           ", not 1");
}

void checkFeature(const FeatureState& feature) {
  const std::string name = "feature " + std::to_string(feature.id);
  if (feature.kind != FeatureKind::kInverseDepth && feature.kind != FeatureKind::kPoint)
    refuse(name + " is of no known kind");
  if (!feature.anchor_world.allFinite() || !feature.bearing_world.allFinite() ||
      !feature.tangent_world.allFinite() || !std::isfinite(feature.inverse_depth) ||
      !feature.point_world.allFinite())
    refuse(name + " is not finite");
  if (feature.anchored_at_origin &&
      (feature.kind == FeatureKind::kPoint || !feature.anchor_world.isZero(0.0)))
    refuse(name + " is not anchored at the origin, as it says");
  if (feature.kind == FeatureKind::kPoint) return;
  if (!isUnit(feature.bearing_world) || !isUnit(feature.tangent_world) ||
      std::abs(feature.bearing_world.dot(feature.tangent_world)) > kUnitTolerance)
    refuse(name + " has a bearing and tangent that are not orthonormal");
  if (!(feature.inverse_depth > 0.0))
    refuse(name + " has inverse depth " + std::to_string(feature.inverse_depth) +
           ", not in (0, inf)");
}

void checkCovariance(const Eigen::MatrixXd& P, int size) {
  if (P.rows() != size || P.cols() != size)
    refuse("covariance of " + std::to_string(P.rows()) + " x " + std::to_string(P.cols()) +
           ", the state has " + std::to_string(size));
  // In one pass over the whole; allFinite() goes element by element.
  if (!std::isfinite((0.0 * P).sum())) refuse("the covariance is not finite");
  const Eigen::VectorXd variance = P.diagonal();
  if (!(variance.minCoeff() >= 0.0)) refuse("the covariance has a negative variance");
  // Bounds by standard deviations: products of large variances would overflow.
  const Eigen::VectorXd sigma = variance.cwiseSqrt();
  constexpr int kTile = 32;  // Cost: its columns and rows stay in the cache
  using Column = Eigen::Array<double, Eigen::Dynamic, 1, 0, kTile, 1>;
  for (int begin = 0; begin < size; begin += kTile) {
    const int rows = std::min(kTile, size - begin);
    for (int j = 0; j < begin + rows; ++j) {
      const Column below = P.col(j).segment(begin, rows).array();
      const Column beside = P.row(j).segment(begin, rows).transpose().array();
      const Column bound = sigma.segment(begin, rows).array() * sigma[j];
      const Column slack = kCorrelationTolerance * bound +
                           kRounding * (variance.segment(begin, rows).array() + variance[j]);
      if (((below - beside).abs() - slack).maxCoeff() > 0.0)
        refuse("the covariance is not symmetric");
      if ((below.abs() - bound - slack).maxCoeff() > 0.0)
        refuse("the covariance holds a correlation beyond 1");
    }
  }
}

/// `saved` with rows for a gyroscope's bias of which it knows nothing.
Eigen::MatrixXd withBias(const Eigen::MatrixXd& saved, const Eigen::Matrix3d& P_bias) {
  constexpr int kBefore = CameraError::kGyroBias, kAfter = kBefore + 3;
  const Eigen::Index rest = saved.rows() - kBefore;
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(kAfter + rest, kAfter + rest);
  P.topLeftCorner(kBefore, kBefore) = saved.topLeftCorner(kBefore, kBefore);
  P.topRightCorner(kBefore, rest) = saved.topRightCorner(kBefore, rest);
  P.bottomLeftCorner(rest, kBefore) = saved.bottomLeftCorner(rest, kBefore);
  P.bottomRightCorner(rest, rest) = saved.bottomRightCorner(rest, rest);
  P.block<3, 3>(kBefore, kBefore) = P_bias;
  return P;
}

}  // namespace

void Ekf::restore(const CameraState& camera, const std::vector<FeatureState>& features,
                  const Eigen::MatrixXd& covariance, FeatureId next_id) {
  checkCamera(camera);
  int size = CameraError::kSize;
  FeatureId least_id = 0;
  for (const FeatureState& feature : features) {
    if (feature.id < least_id)
      refuse("feature ids are not ascending at " + std::to_string(feature.id));
    if (feature.id >= next_id)
      refuse("feature id " + std::to_string(feature.id) + " is not below the next id " +
             std::to_string(next_id));
    least_id = feature.id + 1;
    checkFeature(feature);
    size += feature.size();
  }
  if (next_id < 0) refuse("the next id " + std::to_string(next_id) + " is negative");
  checkCovariance(covariance, size);

  const auto gyro_bias_rps = camera_.gyro_bias_rps;
  const Eigen::Matrix3d P_bias = gyro_bias_rps
                                     ? Eigen::Matrix3d(covariance_.view().block<3, 3>(
                                           CameraError::kGyroBias, CameraError::kGyroBias))
                                     : Eigen::Matrix3d::Zero();
  camera_ = camera;
  camera_.gyro_bias_rps = gyro_bias_rps;
  features_ = features;
  assignOffsets();
  impulse_.reset();
  if (gyro_bias_rps) {
    covariance_.assign(withBias(covariance, P_bias));
  } else {
    covariance_.assign(covariance);
  }
  next_id_ = next_id;
}

Eigen::MatrixXd Ekf::savedCovariance() const {
  const auto P = covariance_.view();
  if (!camera_.gyro_bias_rps) return P;
  constexpr int kBefore = CameraError::kGyroBias, kAfter = kBefore + 3;
  const int rest = covariance_.size() - kAfter;
  Eigen::MatrixXd saved(kBefore + rest, kBefore + rest);
  saved << P.topLeftCorner(kBefore, kBefore), P.topRightCorner(kBefore, rest),
      P.bottomLeftCorner(rest, kBefore), P.bottomRightCorner(rest, rest);
  return saved;
}

void Ekf::relocateCamera(const CameraState& camera, const MotionCovariance& covariance) {
  const CameraState before = camera_;
  camera_ = camera;
  camera_.q_world_camera.normalize();
  camera_.gyro_bias_rps = before.gyro_bias_rps;
  camera_.readout_s = before.readout_s;
  camera_.lens = before.lens;
  impulse_.reset();
  auto P = covariance_.view();
  const int rest = covariance_.size() - CameraError::kMotionSize;
  P.topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>() =
      0.5 * (covariance + covariance.transpose());
  P.topRightCorner(CameraError::kMotionSize, rest).setZero();
  P.bottomLeftCorner(rest, CameraError::kMotionSize).setZero();
}

}  // namespace active_matching_slam
