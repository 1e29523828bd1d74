#include "loop_finder.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/submaps/ekf_active_map.h"

namespace active_matching_slam {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

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
/// Noise of a landmark's match per axis [px] at least. Derivation: that of matches to a pixel, of
/// templates that were taken long ago.
constexpr double kLeastSigmaPx = 1.0;

Vector6 poseDifference(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  Vector6 difference;
  difference << to.translation() - from.translation(),
      vectorFromRotation(Eigen::Quaterniond(to.linear() * from.linear().transpose()));
  return difference;
}

double squaredDistance(const Vector6& difference, const Matrix6& covariance) {
  const Eigen::LLT<Matrix6> factor(covariance);
  if (factor.info() != Eigen::Success || !difference.allFinite())
    return std::numeric_limits<double>::infinity();
  return difference.dot(factor.solve(difference));
}

/// Of a camera found by its landmarks, by the noise of their pixels.
Matrix6 foundCovariance(const CameraModel& camera, const PointInsertion& points,
                        const Relocalisation& found) {
  Matrix6 information = Matrix6::Zero();
  const Eigen::Matrix3d R_camera_world = found.T_world_camera.linear().transpose();
  for (const FeatureMeasurement& inlier : found.inliers) {
    for (const FeatureState& feature : points.features) {
      if (feature.id != inlier.id) continue;
      const Eigen::Vector3d ray = feature.point_world - found.T_world_camera.translation();
      Eigen::Matrix<double, 2, 3> d_pixel;
      if (!camera.project(R_camera_world * ray, &d_pixel)) continue;
      Eigen::Matrix<double, 2, 6> J;
      J << -d_pixel * R_camera_world, d_pixel * R_camera_world * skew(ray);
      information += J.transpose() * J;
    }
  }
  // Residuals along both axes, of which six were used up.
  const double sigma_px = std::max(found.rms_px / std::sqrt(2.0), kLeastSigmaPx);
  const Eigen::LDLT<Matrix6> factor(information);
  return sigma_px * sigma_px * factor.solve(Matrix6::Identity());
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
