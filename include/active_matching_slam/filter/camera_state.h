#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "active_matching_slam/camera/camera_model.h"

namespace active_matching_slam {

/// Mean of the camera in the filter: its motion (Chli 2009, eq. 3.3; 13 numbers, 12 in the error
/// state) and what its calibration lacks (5 numbers).
struct CameraState {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< camera centre r_W [m or map units]
  Eigen::Quaterniond q_world_camera = Eigen::Quaterniond::Identity();  ///< unit; camera to world
  Eigen::Vector3d velocity_world = Eigen::Vector3d::Zero();            ///< v_W [m/s]
  Eigen::Vector3d angular_velocity_camera =
      Eigen::Vector3d::Zero();  ///< w_C, in the camera frame [rad/s]
  /// From the exposure of the first row to that of the last [s]; the state is that of the middle
  /// row. 0 for a global shutter, negative when read from below.
  double readout_s = 0.0;
  LensCorrection lens;
  /// Of a gyroscope, in the camera frame [rad/s]; part of the state only where there is one.
  std::optional<Eigen::Vector3d> gyro_bias_rps;

  /// Camera points into the world.
  Eigen::Isometry3d poseWorldCamera() const {
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    T_world_camera.linear() = q_world_camera.toRotationMatrix();
    T_world_camera.translation() = position_world;
    return T_world_camera;
  }
  void setPoseWorldCamera(const Eigen::Isometry3d& T_world_camera) {
    position_world = T_world_camera.translation();
    q_world_camera = Eigen::Quaterniond(T_world_camera.linear()).normalized();
  }
};

/// Order of the camera's error state in every covariance: additive position, rotation as a
/// world-frame rotation vector (R_true = exp([rotation]x) R_mean), additive velocity, additive
/// angular velocity; then, additive, readout and lens, and the gyroscope's bias where the state has
/// one.
struct CameraError {
  static constexpr int kPosition = 0, kRotation = 3, kVelocity = 6, kAngularVelocity = 9,
                       kMotionSize = 12, kReadout = 12, kFocal = 13, kRadial = 14, kCentre = 15,
                       kSize = 17, kCalibrationSize = kSize - kMotionSize, kGyroBias = kSize;
};

/// Rows of the camera's error: those of the features follow.
inline int cameraErrorSize(const CameraState& camera) {
  return CameraError::kSize + (camera.gyro_bias_rps ? 3 : 0);
}

/// Covariance of the motion alone, in the order of CameraError.
using MotionCovariance = Eigen::Matrix<double, CameraError::kMotionSize, CameraError::kMotionSize>;

/// Readout and lens in the order of CameraError.
using CalibrationVector = Eigen::Matrix<double, CameraError::kCalibrationSize, 1>;

}  // namespace active_matching_slam
