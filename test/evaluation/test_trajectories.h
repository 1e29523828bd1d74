#pragma once

#include <unistd.h>

#include <cmath>
#include <random>
#include <string>

#include "active_matching_slam/evaluation/trajectory.h"

namespace active_matching_slam {

/// A smooth, hand-held-like motion of `count` poses.
inline Trajectory randomTrajectory(int count, double rate_hz = 30.0) {
  Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    const double t = i / rate_hz;
    StampedPose pose;
    pose.stamp_s = t;
    pose.T_world_camera.translation() << std::sin(0.9 * t), 0.4 * std::cos(1.7 * t) - 0.4,
        0.3 * std::sin(0.5 * t + 0.3);
    pose.T_world_camera.linear() =
        (Eigen::AngleAxisd(0.3 * std::sin(t), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.2 * std::cos(0.7 * t), Eigen::Vector3d(1, 0, 1).normalized()))
            .toRotationMatrix();
    trajectory.push_back(pose);
  }
  return trajectory;
}

/// The same motion as another observer states it: x' = scale * R x + t.
inline Trajectory transformed(Trajectory trajectory, double scale, const Eigen::Matrix3d& R,
                              const Eigen::Vector3d& t) {
  for (StampedPose& pose : trajectory) {
    const Eigen::Vector3d position = scale * (R * pose.T_world_camera.translation()) + t;
    pose.T_world_camera.linear() = R * pose.T_world_camera.linear();
    pose.T_world_camera.translation() = position;
  }
  return trajectory;
}

inline Eigen::Matrix3d someRotation() {
  return Eigen::AngleAxisd(1.2, Eigen::Vector3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
}

inline std::string temporaryPath(const std::string& name) {
  return "/tmp/ams_evaluation_" + std::to_string(getpid()) + "_" + name;
}

}  // namespace active_matching_slam
