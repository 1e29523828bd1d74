#include "active_matching_slam/math/rotation.h"

#include <cmath>

namespace active_matching_slam {
namespace {

constexpr double kSmallAngle2 = 1e-6;  // [rad^2]; the series below are exact to 1e-18 there

}  // namespace

Eigen::Quaterniond rotationFromVector(const Eigen::Vector3d& v) {
  const double angle2 = v.squaredNorm();
  const double angle = std::sqrt(angle2);
  const double half_sinc = angle2 < kSmallAngle2 ? 0.5 - angle2 / 48.0 + angle2 * angle2 / 3840.0
                                                 : std::sin(0.5 * angle) / angle;
  const Eigen::Vector3d xyz = half_sinc * v;
  return Eigen::Quaterniond(std::cos(0.5 * angle), xyz.x(), xyz.y(), xyz.z()).normalized();
}

Eigen::Vector3d vectorFromRotation(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const double sin_half = q.vec().norm();
  if (sin_half < 1e-8) return 2.0 * sign * q.vec();
  return (2.0 * sign * std::atan2(sin_half, sign * q.w()) / sin_half) * q.vec();
}

Eigen::Matrix3d leftJacobian(const Eigen::Vector3d& v) {
  const double angle2 = v.squaredNorm();
  double a, b;  // (1 - cos)/angle^2, (angle - sin)/angle^3
  if (angle2 < kSmallAngle2) {
    a = 0.5 - angle2 / 24.0;
    b = 1.0 / 6.0 - angle2 / 120.0;
  } else {
    const double angle = std::sqrt(angle2);
    a = (1.0 - std::cos(angle)) / angle2;
    b = (angle - std::sin(angle)) / (angle2 * angle);
  }
  const Eigen::Matrix3d V = skew(v);
  return Eigen::Matrix3d::Identity() + a * V + b * V * V;
}

}  // namespace active_matching_slam
