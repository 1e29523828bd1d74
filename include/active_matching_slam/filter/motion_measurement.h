#pragma once

#include <Eigen/Core>
#include <optional>

namespace active_matching_slam {

struct UncertainVector {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// What is known of the camera's motion from one image to the next besides that it goes on as it
/// did: by what the robot's odometry, or a gyroscope, says.
struct MotionMeasurement {
  /// Mean over the interval, in the camera frame [rad/s]: the logarithm of its rotation over its
  /// length.
  UncertainVector angular_velocity_camera;
  /// The camera's displacement over the interval by its length, in the frame of the camera as it
  /// was at the start [m/s]. None: only rotation is known.
  std::optional<UncertainVector> velocity_start;
  /// By a gyroscope: the angular velocity and its bias together.
  bool is_biased = false;
  double bias_walk_rps = 0.0;  ///< by how much the bias has changed, standard deviation per axis
};

}  // namespace active_matching_slam
