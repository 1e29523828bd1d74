#include "active_matching_slam/simulation/robot_sensors.h"

#include <cmath>

#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/simulation/random.h"

namespace active_matching_slam {
namespace {

/// Of the differences that accelerations are made of [s]. Derivation: motions have no parts faster
/// than some tenths of a second.
constexpr double kDifferenceS = 1e-3;

class RandomVector {
 public:
  explicit RandomVector(std::uint64_t seed) : random_(seed) {}
  /// Gaussian (Box & Muller).
  Eigen::Vector3d operator()(double sigma) {
    Eigen::Vector3d v;
    for (int i = 0; i < 3; ++i)
      v[i] = sigma * std::sqrt(-2.0 * std::log(1.0 - random_.uniform())) *
             std::cos(2.0 * M_PI * random_.uniform());
    return v;
  }
  /// Of the given size per axis, of either sign.
  Eigen::Vector3d signs(double size) {
    Eigen::Vector3d v;
    for (int i = 0; i < 3; ++i) v[i] = size * random_.sign();
    return v;
  }

 private:
  Random random_;
};

}  // namespace

Eigen::Isometry3d simulatedCameraOnBase() {
  Eigen::Isometry3d T_base_camera = Eigen::Isometry3d::Identity();
  T_base_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  T_base_camera.translation() << 0.1, 0.0, 0.3;
  return T_base_camera;
}

std::vector<SimulatedOdometry> simulateOdometry(const MotionTruth& truth, double begin_s,
                                                double end_s, const RobotSensorOptions& options) {
  const Eigen::Isometry3d T_camera_base = simulatedCameraOnBase().inverse();
  const double interval_s = 1.0 / options.odometry_rate_hz;
  const int samples = static_cast<int>(std::floor((end_s - begin_s) / interval_s)) + 1;
  const double slip_begin_s = 0.5 * (begin_s + end_s);
  RandomVector random(options.seed);
  Eigen::Isometry3d T_world_before, T_odom_base = Eigen::Isometry3d::Identity();
  std::vector<SimulatedOdometry> odometry;
  for (int i = 0; i < samples; ++i) {
    const double stamp_s = begin_s + i * interval_s;
    const Eigen::Isometry3d T_world_base = truth(stamp_s).T_world_camera * T_camera_base;
    if (i > 0) {
      Eigen::Isometry3d step = T_world_before.inverse() * T_world_base;
      const double way_m = step.translation().norm();
      const double turn_rad = vectorFromRotation(Eigen::Quaterniond(step.linear())).norm();
      step.translation() += random(options.odometry_sigma_m * std::sqrt(way_m));
      step.linear() = step.linear() *
                      rotationFromVector(random(options.odometry_sigma_rad * std::sqrt(turn_rad)))
                          .toRotationMatrix();
      const bool slips =
          stamp_s > slip_begin_s && stamp_s <= slip_begin_s + options.slip_duration_s;
      if (slips) step.translation().x() += options.slip_m * interval_s / options.slip_duration_s;
      T_odom_base = T_odom_base * step;
      T_odom_base.linear() = Eigen::Quaterniond(T_odom_base.linear()).normalized().matrix();
    }
    odometry.push_back({stamp_s, T_odom_base});
    T_world_before = T_world_base;
  }
  return odometry;
}

std::vector<SimulatedInertial> simulateInertial(const MotionTruth& truth, double begin_s,
                                                double end_s, const RobotSensorOptions& options) {
  const Eigen::Isometry3d T_base_camera = simulatedCameraOnBase();
  const double interval_s = 1.0 / options.imu_rate_hz;
  const int samples = static_cast<int>(std::floor((end_s - begin_s) / interval_s)) + 1;
  RandomVector random(options.seed);
  const Eigen::Vector3d gyro_bias = random.signs(options.gyro_bias_rps);
  const Eigen::Vector3d acceleration_bias = random.signs(options.accelerometer_bias_mps2);
  const double per_sample = std::sqrt(options.imu_rate_hz);
  const auto baseVelocity = [&](double t) {
    const MotionSample m = truth(t);
    const Eigen::Vector3d lever = -T_base_camera.linear().transpose() * T_base_camera.translation();
    return Eigen::Vector3d(m.velocity_world +
                           m.T_world_camera.linear() * m.angular_velocity_camera.cross(lever));
  };
  std::vector<SimulatedInertial> inertial;
  for (int i = 0; i < samples; ++i) {
    const double stamp_s = begin_s + i * interval_s;
    const MotionSample m = truth(stamp_s);
    const Eigen::Vector3d acceleration_world =
        (baseVelocity(stamp_s + kDifferenceS) - baseVelocity(stamp_s - kDifferenceS)) /
        (2.0 * kDifferenceS);
    const Eigen::Matrix3d R_base_world =
        T_base_camera.linear() * m.T_world_camera.linear().transpose();
    inertial.push_back({stamp_s,
                        T_base_camera.linear() * m.angular_velocity_camera + gyro_bias +
                            random(options.gyro_sigma_rps * per_sample),
                        R_base_world * (acceleration_world - options.gravity_world) +
                            acceleration_bias +
                            random(options.accelerometer_sigma_mps2 * per_sample)});
  }
  return inertial;
}

}  // namespace active_matching_slam
