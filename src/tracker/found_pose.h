#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/map/relocaliser.h"

namespace active_matching_slam {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Covariance of position and rotation of a camera that was found, in its own frame, by the noise
/// of the pixels in which it sees `points_world`; those are taken to be certain.
Matrix6 foundPoseCovariance(const CameraModel& camera, const Relocalisation& found,
                            const std::vector<Eigen::Vector3d>& points_world);

/// Squared Mahalanobis distance; infinite where the covariance is not positive definite.
double squaredDistance(const Vector6& difference, const Matrix6& covariance);

}  // namespace active_matching_slam
