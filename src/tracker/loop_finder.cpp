#include "loop_finder.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "found_pose.h"

namespace active_matching_slam {
namespace {

/// Of a camera's offset. Cost: of one right loop in ten thousand a second look is taken.
constexpr double kExpectedProbability = 0.9999;
/// Standard deviations of a drift over those that the filter knows of, at most. Cost: a larger
/// drift is not corrected. Two images of a place that only looks like another say the same, too: so
/// they do not count at any distance. (Filters were found too sure by 2 to 3 where the lens or the
/// shutter was not as told.)
constexpr double kPossibleInflation = 5.0;
constexpr int kPoseFreedoms = 6;
/// Images that a look counts for. Cost: a mistake has so long to be made twice.
constexpr std::int64_t kLookMemoryImages = 100;

Vector6 poseDifference(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  Vector6 difference;
  difference << to.translation() - from.translation(),
      vectorFromRotation(Eigen::Quaterniond(to.linear() * from.linear().transpose()));
  return difference;
}

/// Of a camera found by its landmarks, as errors in the world.
Matrix6 foundCovariance(const CameraModel& camera, const PointInsertion& points,
                        const Relocalisation& found) {
  std::vector<Eigen::Vector3d> seen;
  for (const FeatureMeasurement& inlier : found.inliers)
    for (const FeatureState& feature : points.features)
      if (feature.id == inlier.id) seen.push_back(feature.point_world);
  Matrix6 world_from_camera = Matrix6::Zero();
  world_from_camera.topLeftCorner<3, 3>() = found.T_world_camera.linear();
  world_from_camera.bottomRightCorner<3, 3>() = found.T_world_camera.linear();
  return world_from_camera * foundPoseCovariance(camera, found, seen) *
         world_from_camera.transpose();
}

/// Of points about a centre, to their motion as a body: translation of the centre and rotation, 6 x
/// 3n. What makes the body grow is told apart from it, and left out: it moves no camera that the
/// body shows.
Eigen::MatrixXd bodyMotion(const std::vector<FeatureState>& points, const Eigen::Vector3d& centre) {
  Eigen::MatrixXd A(3 * static_cast<Eigen::Index>(points.size()), 7);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d r = points[i].point_world - centre;
    A.middleRows<3>(3 * static_cast<Eigen::Index>(i)) << Eigen::Matrix3d::Identity(), -skew(r), r;
  }
  const Eigen::Matrix<double, 7, 7> normal = A.transpose() * A;
  const Eigen::Matrix<double, 7, Eigen::Dynamic> fit = normal.ldlt().solve(A.transpose());
  return fit.topRows<6>();
}

}  // namespace

bool CameraOffset::isExpected() const {
  return squared <= chiSquareQuantile(kPoseFreedoms, kExpectedProbability);
}

bool CameraOffset::isPossible() const {
  return squared <= kPossibleInflation * kPossibleInflation *
                        chiSquareQuantile(kPoseFreedoms, kExpectedProbability);
}

CameraOffset offsetFromSubmap(const Ekf& filter, const CameraModel& camera,
                              const Conditional& points, const Relocalisation& found) {
  CameraOffset result;
  const PointInsertion joint = pointInsertion(filter, points);
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  result.offset = poseDifference(T_world_camera, found.T_world_camera);
  // About the camera found: offset = error of the camera less the body's.
  const Eigen::MatrixXd F = bodyMotion(joint.features, found.T_world_camera.translation());
  const Eigen::MatrixXd cross = F * joint.cross_covariance.leftCols<kPoseFreedoms>();
  result.predicted = filter.covariance().topLeftCorner<kPoseFreedoms, kPoseFreedoms>();
  result.predicted += F * joint.own_covariance * F.transpose();
  result.predicted -= cross + cross.transpose();
  result.found = foundCovariance(camera, joint, found);
  result.squared = squaredDistance(result.offset, result.predicted + result.found);
  return result;
}

void loosenCamera(const Matrix6& added, const std::vector<FeatureId>& carried, Ekf* filter) {
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(filter->stateSize(), kPoseFreedoms);
  const CameraState& camera = filter->camera();
  const auto move = [&](const Eigen::Vector3d& p, int row) {
    G.block<3, 3>(row, 0).setIdentity();
    G.block<3, 3>(row, 3) = -skew(p - camera.position_world);
  };
  move(camera.position_world, CameraError::kPosition);
  G.block<3, 3>(CameraError::kRotation, 3).setIdentity();
  G.block<3, 3>(CameraError::kVelocity, 3) = -skew(camera.velocity_world);
  for (const FeatureState& feature : filter->features()) {
    if (!std::binary_search(carried.begin(), carried.end(), feature.id)) continue;
    if (feature.kind == FeatureKind::kPoint) {
      move(feature.point_world, feature.offset);
      continue;
    }
    if (feature.hasAnchorError()) move(feature.anchor_world, feature.offset);
    G.block<2, 3>(feature.bearingRow(), 3) = bearingGauge(feature);
  }
  filter->inflate(G * added * G.transpose());
}

bool LoopWitness::confirms(std::int64_t image, const Eigen::Isometry3d& T_world_camera,
                           const Relocalisation& found, const CameraOffset& offset) {
  if (!offset.isPossible()) return false;
  looks_.erase(
      std::remove_if(looks_.begin(), looks_.end(),
                     [image](const Look& look) { return image - look.image > kLookMemoryImages; }),
      looks_.end());
  const double limit = chiSquareQuantile(kPoseFreedoms, kExpectedProbability);
  const bool is_confirmed = std::any_of(looks_.begin(), looks_.end(), [&](const Look& look) {
    const Vector6 difference =
        poseDifference(look.T_old_new * T_world_camera, found.T_world_camera);
    return look.image != image &&
           squaredDistance(difference, look.covariance + offset.found) <= limit;
  });
  looks_.push_back({image, found.T_world_camera * T_world_camera.inverse(), offset.found});
  return is_confirmed;
}

}  // namespace active_matching_slam
