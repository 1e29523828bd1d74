#pragma once

#include <Eigen/Geometry>

namespace active_matching_slam {

/// Mean of the camera in the filter (Chli 2009, eq. 3.3): 13 numbers, 12 in the error state.
struct CameraState {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< camera centre r_W [m or map units]
  Eigen::Quaterniond q_world_camera = Eigen::Quaterniond::Identity();  ///< unit; camera to world
  Eigen::Vector3d velocity_world = Eigen::Vector3d::Zero();            ///< v_W [m/s]
  Eigen::Vector3d angular_velocity_camera =
      Eigen::Vector3d::Zero();  ///< w_C, in the camera frame [rad/s]

  /// Camera points into the world.
  Eigen::Isometry3d poseWorldCamera() const {
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    T_world_camera.linear() = q_world_camera.toRotationMatrix();
    T_world_camera.translation() = position_world;
    return T_world_camera;
  }
};

/// Order of the camera's error state in every covariance: additive position, rotation as a
/// world-frame rotation vector (R_true = exp([rotation]x) R_mean), additive velocity, additive
/// angular velocity.
struct CameraError {
  static constexpr int kPosition = 0, kRotation = 3, kVelocity = 6, kAngularVelocity = 9,
                       kSize = 12;
};

}  // namespace active_matching_slam
