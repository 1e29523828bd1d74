#include <cmath>

#include "active_matching_slam/tracker/ground_plane.h"
#include "scale_acceptance.h"
#include "tracker_implementation.h"

namespace active_matching_slam {

/// All that the map has around the camera.
std::vector<PointBelow> Tracker::Implementation::pointsAround() const {
  const CameraState& camera = filter_.camera();
  const Eigen::Matrix3d R_camera_world = camera.q_world_camera.toRotationMatrix().transpose();
  const auto P = filter_.covariance();
  std::vector<PointBelow> points;
  for (const FeatureState& feature : filter_.features()) {
    PointBelow point;
    const Eigen::Vector3d offset = feature.position() - camera.position_world;
    Eigen::Matrix3d covariance;
    if (feature.kind == FeatureKind::kPoint) {
      const int o = feature.offset;
      covariance =
          P.block<3, 3>(o, o) + P.topLeftCorner<3, 3>() - P.block<3, 3>(o, 0) - P.block<3, 3>(0, o);
    } else {
      // Along its ray; what the camera has moved since it was seen first is known far better.
      const double sigma = filter_.sigmaInverseDepth(feature) / std::pow(feature.inverse_depth, 2);
      covariance = sigma * sigma * feature.bearing_world * feature.bearing_world.transpose();
    }
    point.position_camera = R_camera_world * offset;
    point.covariance = R_camera_world * covariance * R_camera_world.transpose();
    points.push_back(point);
  }
  return points;
}

/// While the scale is free: takes it from how high the camera is over the ground.
void Tracker::Implementation::scaleByGround(TrackedFrame* frame) {
  if (!options_.ground.isKnown() || !canBecomeMetric()) return;
  Eigen::Vector3d down_camera = options_.ground.downCamera();
  if (motion_history_ && options_.motion.hasOdometry())
    if (const auto& T_base_camera = motion_history_->camera())
      down_camera = -T_base_camera->linear().row(2).transpose();
  const auto ground = findGround(pointsAround(), down_camera, options_.ground);
  if (!ground || ground->relative_sigma > kLargestScaleSigma) return;
  becomeMetric(options_.ground.camera_height_m / ground->height, ground->relative_sigma,
               ScaleSource::kCameraHeight, frame);
}

}  // namespace active_matching_slam
