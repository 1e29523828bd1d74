#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "active_matching_slam/filter/motion_measurement.h"
#include "active_matching_slam/tracker/motion_options.h"

namespace active_matching_slam {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A pose of the robot's base as its odometry has it.
struct OdometrySample {
  double stamp_s = 0.0;
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  /// Of the pose in the odometry's frame and of the velocity in the base's, position before
  /// rotation, as nav_msgs/Odometry has them; zero: not stated.
  Matrix6 pose_covariance = Matrix6::Zero(), twist_covariance = Matrix6::Zero();
};

/// Angular velocity of an IMU in its own axes [rad/s].
struct GyroSample {
  double stamp_s = 0.0;
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
};

/// What a robot's sensors have said of its motion, by their stamps: the seam between these and the
/// filter. Of any interval it tells how the camera moved, or why that is not known. One thread at a
/// time.
class MotionHistory {
 public:
  /// Throws std::invalid_argument, see checkMotionOptions().
  explicit MotionHistory(const MotionOptions& options);
  void setOptions(const MotionOptions& options);
  /// Where the camera is on the robot's base (odometry), or in the axes of the IMU (gyro).
  void setCamera(const Eigen::Isometry3d& T_base_camera) { T_base_camera_ = T_base_camera; }
  void forgetCamera() { T_base_camera_.reset(); }
  bool hasCamera() const { return T_base_camera_.has_value(); }
  const std::optional<Eigen::Isometry3d>& camera() const { return T_base_camera_; }

  /// What is wrong with a sample, which is then left out, or with its covariances, in place of
  /// which those of the options count; empty: nothing. A stamp that runs back by
  /// more than a second is another time: what was before it is forgotten.
  std::string add(const OdometrySample& sample);
  std::string add(const GyroSample& sample);

  /// How the camera moved, or nothing, and `why` says why.
  std::optional<MotionMeasurement> between(double from_s, double to_s, std::string* why) const;
  /// Stamp of the newest sample; none yet: minus infinity.
  double newest_s() const;

 private:
  MotionMeasurement odometryBetween(double from_s, double to_s) const;
  MotionMeasurement gyroBetween(double from_s, double to_s) const;
  Matrix6 covarianceOf(const OdometrySample& from, const OdometrySample& to, double interval_s,
                       const Eigen::Isometry3d& T_from_to) const;

  MotionOptions options_;
  std::optional<Eigen::Isometry3d> T_base_camera_;
  std::deque<OdometrySample> odometry_;  ///< ascending stamps
  std::deque<GyroSample> gyro_;          ///< likewise
};

}  // namespace active_matching_slam
