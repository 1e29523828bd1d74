#pragma once

#include <Eigen/Geometry>

namespace active_matching_slam {

/// [v]x, so that skew(a) * b = a x b.
inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// Unit quaternion of the rotation vector `v` [rad]: exp([v]x). Accurate down to v = 0.
Eigen::Quaterniond rotationFromVector(const Eigen::Vector3d& v);

/// Rotation vector [rad] of a unit quaternion, at most pi long.
Eigen::Vector3d vectorFromRotation(const Eigen::Quaterniond& q);

/// Left Jacobian of SO(3): exp(v + d) = exp(leftJacobian(v) d) exp(v) to first order in d.
Eigen::Matrix3d leftJacobian(const Eigen::Vector3d& v);

}  // namespace active_matching_slam
