#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "active_matching_slam/math/feature_id.h"

namespace active_matching_slam {

enum class FeatureKind { kInverseDepth, kPoint };

/// Mean of a map feature (Chli 2009, eq. 3.4). Error state: inverse depth 6 = anchor (3), bearing
/// (2, tangent of the unit sphere), inverse depth (1); point 3. One whose anchor is the world's
/// origin itself, of which nothing can be uncertain, has no error of the anchor: 3.
struct FeatureState {
  FeatureId id = -1;
  FeatureKind kind = FeatureKind::kInverseDepth;
  bool anchored_at_origin = false;                         ///< kInverseDepth only
  int offset = 0;                                          ///< first row in the filter's covariance
  Eigen::Vector3d anchor_world = Eigen::Vector3d::Zero();  ///< camera centre at first sight
  Eigen::Vector3d bearing_world = Eigen::Vector3d::UnitZ();  ///< m(theta, phi), unit
  /// First axis of the bearing's error, unit and normal to it. Moves with the bearing.
  Eigen::Vector3d tangent_world = Eigen::Vector3d::UnitX();
  double inverse_depth = 0.0;                             ///< rho along the bearing [1/m]
  Eigen::Vector3d point_world = Eigen::Vector3d::Zero();  ///< kPoint only

  /// Columns: the axes of the bearing's error; with the bearing a right-handed frame.
  Eigen::Matrix<double, 3, 2> tangentBasis() const {
    Eigen::Matrix<double, 3, 2> basis;
    basis << tangent_world, bearing_world.cross(tangent_world);
    return basis;
  }
  /// Takes all its lengths times `factor`.
  void rescale(double factor) {
    anchor_world *= factor;
    point_world *= factor;
    if (kind == FeatureKind::kInverseDepth) inverse_depth /= factor;
  }
  /// Rows of its error in the filter's covariance, from `offset`.
  int size() const { return hasAnchorError() ? 6 : 3; }
  bool hasAnchorError() const { return kind == FeatureKind::kInverseDepth && !anchored_at_origin; }
  /// First rows of the parts of its error; that of the anchor, and of a point, is `offset`.
  int bearingRow() const { return anchored_at_origin ? offset : offset + 3; }
  int inverseDepthRow() const { return bearingRow() + 2; }
  /// Position in the world (for inverse depth the mean's; far away as rho -> 0).
  Eigen::Vector3d position() const {
    return kind == FeatureKind::kPoint
               ? point_world
               : Eigen::Vector3d(anchor_world + bearing_world / inverse_depth);
  }
};

/// Homogeneous world point (X, w), w >= 0: position X / w, at infinity for w = 0.
/// For inverse depth (rho * anchor + m, rho), which stays finite as rho -> 0.
inline Eigen::Vector4d homogeneousPosition(const FeatureState& feature) {
  Eigen::Vector4d point;
  if (feature.kind == FeatureKind::kPoint) {
    point << feature.point_world, 1.0;
  } else {
    const double rho = std::max(feature.inverse_depth, 0.0);
    point << rho * feature.anchor_world + feature.bearing_world, rho;
  }
  return point;
}

}  // namespace active_matching_slam
