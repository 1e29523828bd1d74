#pragma once

#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// Matched at pixel (50, 40).
inline TrackedFeature pointFeature(FeatureId id, const Eigen::Vector3d& position) {
  TrackedFeature feature;
  feature.id = id;
  feature.kind = FeatureKind::kPoint;
  feature.position_world = position;
  feature.covariance_world = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  feature.status = FeatureStatus::kMatched;
  feature.predicted_px = feature.matched_px = Eigen::Vector2d(50, 40);
  feature.innovation_covariance_px2 = Eigen::Matrix2d::Identity();
  return feature;
}

}  // namespace active_matching_slam
