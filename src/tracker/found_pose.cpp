#include "found_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

/// Noise of a landmark's match per axis [px] at least. Derivation: that of matches to a pixel, of
/// templates that were taken long ago.
constexpr double kLeastSigmaPx = 1.0;

}  // namespace

Matrix6 foundPoseCovariance(const CameraModel& camera, const Relocalisation& found,
                            const std::vector<Eigen::Vector3d>& points_world) {
  Matrix6 information = Matrix6::Zero();
  const Eigen::Isometry3d T_camera_world = found.T_world_camera.inverse();
  for (const Eigen::Vector3d& point_world : points_world) {
    const Eigen::Vector3d point = T_camera_world * point_world;
    Eigen::Matrix<double, 2, 3> d_pixel;
    if (!camera.project(point, &d_pixel)) continue;
    Eigen::Matrix<double, 2, 6> J;
    J << -d_pixel, d_pixel * skew(point);
    information += J.transpose() * J;
  }
  const double sigma_px = std::max(found.rms_px / std::sqrt(2.0), kLeastSigmaPx);  // of one axis
  return sigma_px * sigma_px * information.ldlt().solve(Matrix6::Identity());
}

double squaredDistance(const Vector6& difference, const Matrix6& covariance) {
  const Eigen::LLT<Matrix6> factor(covariance);
  if (factor.info() != Eigen::Success || !difference.allFinite())
    return std::numeric_limits<double>::infinity();
  return difference.dot(factor.solve(difference));
}

}  // namespace active_matching_slam
