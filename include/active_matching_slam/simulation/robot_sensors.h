#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <vector>

#include "active_matching_slam/simulation/motions.h"

namespace active_matching_slam {

/// Errors of a robot's odometry and IMU. Random errors grow as the root of what they add up over.
struct RobotSensorOptions {
  double odometry_rate_hz = 50.0, imu_rate_hz = 200.0;
  double odometry_sigma_m = 0.02;    ///< per axis, after a metre
  double odometry_sigma_rad = 0.01;  ///< per axis, after a radian
  double slip_m = 0.1;               ///< of the wheels, once, half way through: forward
  double slip_duration_s = 0.1;
  double gyro_sigma_rps = 0.001;           ///< of the mean over a second
  double gyro_bias_rps = 0.02;             ///< per axis, of either sign
  double accelerometer_sigma_mps2 = 0.01;  ///< of the mean over a second
  double accelerometer_bias_mps2 = 0.05;   ///< per axis, of either sign
  Eigen::Vector3d gravity_world = Eigen::Vector3d(0.0, 0.0, -9.81);
  std::uint64_t seed = 1;
};

struct SimulatedOdometry {
  double stamp_s;
  Eigen::Isometry3d T_odom_base;  ///< begins where the base does
};

struct SimulatedInertial {
  double stamp_s;
  Eigen::Vector3d angular_velocity, acceleration;  ///< in the base's axes [rad/s, m/s^2]
};

/// The camera on the robot: 0.3 m above the base's origin and 0.1 m before it, looking forward
/// (x forward, y left, z up).
Eigen::Isometry3d simulatedCameraOnBase();

/// What odometry and an IMU would say of a camera's motion, from `begin_s` to `end_s`.
using MotionTruth = std::function<MotionSample(double stamp_s)>;
std::vector<SimulatedOdometry> simulateOdometry(const MotionTruth& truth, double begin_s,
                                                double end_s, const RobotSensorOptions& options);
std::vector<SimulatedInertial> simulateInertial(const MotionTruth& truth, double begin_s,
                                                double end_s, const RobotSensorOptions& options);

}  // namespace active_matching_slam
