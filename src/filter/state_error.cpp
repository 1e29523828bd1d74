#include "active_matching_slam/filter/state_error.h"

#include <Eigen/LU>
#include <algorithm>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

void turnBearing(const Eigen::Vector2d& error, const Eigen::Vector3d& theta,
                 FeatureState& feature) {
  const Eigen::Vector3d& m = feature.bearing_world;
  const Eigen::Vector3d direction = feature.tangentBasis() * error;
  const Eigen::Quaterniond turn = rotationFromVector(m.cross(direction) + m * m.dot(theta));
  feature.bearing_world = (turn * m).normalized();
  const Eigen::Vector3d tangent = turn * feature.tangent_world;
  feature.tangent_world =
      (tangent - feature.bearing_world * feature.bearing_world.dot(tangent)).normalized();
}

}  // namespace

void applyError(const Eigen::Ref<const Eigen::VectorXd>& delta, CameraState& camera,
                std::vector<FeatureState>& features) {
  const Eigen::Vector3d theta = delta.segment<3>(CameraError::kRotation);
  const Eigen::Matrix3d J = leftJacobian(theta);
  camera.position_world += J * delta.segment<3>(CameraError::kPosition);
  camera.velocity_world += J * delta.segment<3>(CameraError::kVelocity);
  camera.angular_velocity_camera += delta.segment<3>(CameraError::kAngularVelocity);
  camera.readout_s += delta[CameraError::kReadout];
  camera.lens.focal += delta[CameraError::kFocal];
  camera.lens.radial += delta[CameraError::kRadial];
  camera.lens.centre += delta.segment<2>(CameraError::kCentre);
  if (camera.gyro_bias_rps) *camera.gyro_bias_rps += delta.segment<3>(CameraError::kGyroBias);
  camera.q_world_camera = (rotationFromVector(theta) * camera.q_world_camera).normalized();
  for (FeatureState& feature : features) {
    if (feature.kind == FeatureKind::kPoint) {
      feature.point_world += J * delta.segment<3>(feature.offset);
      continue;
    }
    if (feature.hasAnchorError()) feature.anchor_world += J * delta.segment<3>(feature.offset);
    turnBearing(delta.segment<2>(feature.bearingRow()), theta, feature);
    feature.inverse_depth += delta[feature.inverseDepthRow()];
  }
}

Eigen::VectorXd errorOfMotion(const Eigen::Isometry3d& T_new_old, const CameraState& camera,
                              const std::vector<FeatureState>& features,
                              const std::vector<FeatureId>& carried, int state_size) {
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(state_size);
  const Eigen::Matrix3d R = T_new_old.linear();
  const Eigen::Vector3d theta = vectorFromRotation(Eigen::Quaterniond(R));
  const Eigen::Matrix3d J_inverse = leftJacobian(theta).inverse();
  const auto move = [&](const Eigen::Vector3d& p, int row) {
    delta.segment<3>(row) = J_inverse * (T_new_old * p - p);
  };
  delta.segment<3>(CameraError::kRotation) = theta;
  move(camera.position_world, CameraError::kPosition);
  delta.segment<3>(CameraError::kVelocity) =
      J_inverse * (R * camera.velocity_world - camera.velocity_world);
  for (const FeatureState& feature : features) {
    if (!std::binary_search(carried.begin(), carried.end(), feature.id)) continue;
    if (feature.kind == FeatureKind::kPoint) {
      move(feature.point_world, feature.offset);
      continue;
    }
    if (feature.hasAnchorError()) move(feature.anchor_world, feature.offset);
    delta.segment<2>(feature.bearingRow()) =
        feature.tangentBasis().transpose() * theta.cross(feature.bearing_world);
  }
  return delta;
}

Eigen::Matrix<double, 2, 3> bearingGauge(const FeatureState& feature) {
  // -B^T [m]x with B = (b1, b2) and b1 x b2 = m.
  Eigen::Matrix<double, 2, 3> gauge;
  gauge.row(0) = feature.bearing_world.cross(feature.tangent_world).transpose();
  gauge.row(1) = -feature.tangent_world.transpose();
  return gauge;
}

Eigen::MatrixXd gaugeGenerators(const CameraState& camera,
                                const std::vector<FeatureState>& features, int state_size) {
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(state_size, kGaugeFreedoms);
  const auto setPosition = [&G](int row, const Eigen::Vector3d& p) {
    G.block<3, 3>(row, 0) = -skew(p);
    G.block<3, 1>(row, 3) = p;
  };
  setPosition(CameraError::kPosition, camera.position_world);
  setPosition(CameraError::kVelocity, camera.velocity_world);
  G.block<3, 3>(CameraError::kRotation, 0).setIdentity();
  for (const FeatureState& feature : features) {
    if (feature.kind == FeatureKind::kPoint) {
      setPosition(feature.offset, feature.point_world);
    } else {
      if (feature.hasAnchorError()) setPosition(feature.offset, feature.anchor_world);
      G.block<2, 3>(feature.bearingRow(), 0) = bearingGauge(feature);
      G(feature.inverseDepthRow(), 3) = -feature.inverse_depth;
    }
  }
  return G;
}

Eigen::MatrixXd gaugeFunctionals(const CameraState& camera,
                                 const std::vector<FeatureState>& features,
                                 const CovarianceMatrix& covariance) {
  // Of the relative scale. Derivation: no depth is known to 1e-4; weights stay finite.
  constexpr double kLeastVariance = 1e-8;
  const auto P = covariance.view();
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(covariance.size(), kGaugeFreedoms);
  L.block<3, 3>(CameraError::kRotation, 0).setIdentity();
  auto scale = L.col(3);
  double weights = 0.0;
  for (const FeatureState& feature : features) {
    const int o = feature.offset;
    if (feature.kind == FeatureKind::kInverseDepth) {
      const int row = feature.inverseDepthRow();
      const double rho = feature.inverse_depth;
      const double weight = 1.0 / (std::max(P(row, row), 0.0) + kLeastVariance * rho * rho);
      scale[row] -= weight * rho;  // weight rho^2 times d rho / rho
      weights += weight * rho * rho;
      continue;
    }
    const Eigen::Vector3d from_camera = feature.point_world - camera.position_world;
    const Eigen::Vector3d u = from_camera / from_camera.squaredNorm();
    const double variance =
        u.dot((P.block<3, 3>(o, o) + P.topLeftCorner<3, 3>() - 2.0 * P.block<3, 3>(o, 0)) * u);
    const double weight = 1.0 / (std::max(variance, 0.0) + kLeastVariance);
    scale.segment<3>(o) += weight * u;
    scale.segment<3>(CameraError::kPosition) -= weight * u;
    weights += weight;
  }
  if (weights > 0.0) scale /= weights;
  return L;
}

}  // namespace active_matching_slam
