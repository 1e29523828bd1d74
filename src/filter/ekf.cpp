#include "active_matching_slam/filter/ekf.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {

Ekf::Ekf(const FilterOptions& options) : options_(options) {
  checkFields(options);
  covariance_.reset(CameraError::kSize);
}

void Ekf::setOptions(const FilterOptions& options) {
  checkFields(options);
  options_ = options;
}

void Ekf::reset(const CameraState& camera, const MotionCovariance& covariance) {
  // The gyroscope is the same in every map.
  const auto gyro_bias_rps = camera_.gyro_bias_rps;
  Eigen::Matrix3d P_bias = Eigen::Matrix3d::Zero();
  if (gyro_bias_rps)
    P_bias = covariance_.view().block<3, 3>(CameraError::kGyroBias, CameraError::kGyroBias);
  camera_ = camera;
  camera_.gyro_bias_rps = gyro_bias_rps;
  camera_.q_world_camera.normalize();
  features_.clear();
  covariance_.reset(cameraErrorSize(camera_));
  impulse_.reset();
  auto P = covariance_.view();
  P.topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>() =
      0.5 * (covariance + covariance.transpose());
  P.diagonal().segment<CameraError::kCalibrationSize>(CameraError::kMotionSize) =
      calibrationSigmas(options_).array().square();
  if (gyro_bias_rps) P.bottomRightCorner<3, 3>() = P_bias;
}

void Ekf::predict(double interval_s, const Accelerations& sigmas) {
  if (!(interval_s > 0.0) || !std::isfinite(interval_s)) return;
  const Eigen::Vector3d turn = camera_.angular_velocity_camera * interval_s;
  const Eigen::Quaterniond q_start = camera_.q_world_camera;
  // exp([R (w + dw) dt]x) R = R exp([(w + dw) dt]x): the rotation error gains K dw in the world.
  const Eigen::Matrix3d K =
      camera_.q_world_camera.toRotationMatrix() * leftJacobian(turn) * interval_s;
  camera_.position_world += camera_.velocity_world * interval_s;
  camera_.q_world_camera = (camera_.q_world_camera * rotationFromVector(turn)).normalized();

  // P <- F P F^T touches the motion's rows and columns only.
  auto P = covariance_.view();
  const int rest = covariance_.size() - CameraError::kMotionSize;
  MotionCovariance F = MotionCovariance::Identity();
  F.block<3, 3>(CameraError::kPosition, CameraError::kVelocity) =
      interval_s * Eigen::Matrix3d::Identity();
  F.block<3, 3>(CameraError::kRotation, CameraError::kAngularVelocity) = K;
  auto P_camera = P.topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>();
  MotionCovariance predicted = F * P_camera * F.transpose();

  // Impulses V = a dt, Omega = alpha dt enter like the velocities themselves (eq. 3.7).
  impulse_ = Impulse{interval_s, F.rightCols<6>(), impulseVariance(sigmas, interval_s), q_start};
  predicted += impulse_->G * impulse_->variance.asDiagonal() * impulse_->G.transpose();
  P_camera = 0.5 * (predicted + predicted.transpose());

  auto motion_rest = P.topRightCorner(CameraError::kMotionSize, rest);
  for (int j = 0; j < rest; ++j) {
    motion_rest.col(j).segment<3>(CameraError::kPosition) +=
        interval_s * motion_rest.col(j).segment<3>(CameraError::kVelocity);
    motion_rest.col(j).segment<3>(CameraError::kRotation) +=
        K * motion_rest.col(j).segment<3>(CameraError::kAngularVelocity);
  }
  P.bottomLeftCorner(rest, CameraError::kMotionSize) = motion_rest.transpose();
}

void Ekf::replaceAccelerations(const Accelerations& sigmas) {
  if (impulse_) replaceImpulse(impulseVariance(sigmas, impulse_->interval_s));
}

void Ekf::replaceImpulse(const Eigen::Matrix<double, 6, 1>& variance) {
  if (!impulse_) return;
  covariance_.view().topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>() +=
      impulse_->G * (variance - impulse_->variance).asDiagonal() * impulse_->G.transpose();
  impulse_->variance = variance;
}

Eigen::Matrix<double, 6, 1> impulseVariance(const Accelerations& sigmas, double interval_s) {
  Eigen::Matrix<double, 6, 1> variance;
  variance.head<3>().setConstant(std::pow(sigmas.linear_mps2 * interval_s, 2));
  variance.tail<3>().setConstant(std::pow(sigmas.angular_rps2 * interval_s, 2));
  return variance;
}

void Ekf::decayVelocity(double fraction) {
  Eigen::Matrix<double, 6, 2> lost = Eigen::Matrix<double, 6, 2>::Zero();
  lost.topLeftCorner<3, 1>() = (1.0 - fraction) * camera_.velocity_world;
  lost.bottomRightCorner<3, 1>() = (1.0 - fraction) * camera_.angular_velocity_camera;
  camera_.velocity_world *= fraction;
  camera_.angular_velocity_camera *= fraction;
  covariance_.view().block<6, 6>(CameraError::kVelocity, CameraError::kVelocity) +=
      lost * lost.transpose();
}

void Ekf::rescale(double factor) {
  if (!(factor > 0.0) || !std::isfinite(factor)) {
    throw std::invalid_argument("scale factor = " + std::to_string(factor) +
                                " is outside (0, inf)");
  }
  impulse_.reset();
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(covariance_.size());
  scale.segment<3>(CameraError::kPosition).setConstant(factor);
  scale.segment<3>(CameraError::kVelocity).setConstant(factor);
  camera_.position_world *= factor;
  camera_.velocity_world *= factor;
  for (FeatureState& feature : features_) {
    feature.rescale(factor);
    if (feature.kind == FeatureKind::kInverseDepth) scale[feature.inverseDepthRow()] = 1.0 / factor;
    if (!feature.anchored_at_origin) scale.segment<3>(feature.offset).setConstant(factor);
  }
  auto P = covariance_.view();
  for (int j = 0; j < P.cols(); ++j) {
    for (int i = 0; i < P.rows(); ++i) P(i, j) *= scale[i] * scale[j];
  }
}

int Ekf::indexOf(FeatureId id) const {
  const auto it = std::lower_bound(features_.begin(), features_.end(), id,
                                   [](const FeatureState& f, FeatureId i) { return f.id < i; });
  return it != features_.end() && it->id == id ? static_cast<int>(it - features_.begin()) : -1;
}

const FeatureState* Ekf::find(FeatureId id) const {
  const int index = indexOf(id);
  return index < 0 ? nullptr : &features_[index];
}

}  // namespace active_matching_slam
