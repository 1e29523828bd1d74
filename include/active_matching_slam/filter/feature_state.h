#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace active_matching_slam {

using FeatureId = std::int64_t;

enum class FeatureKind { kInverseDepth, kPoint };

/// Mean of a map feature (Chli 2009, eq. 3.4). Error state: inverse depth 6 = anchor (3), bearing
/// (2, tangent of the unit sphere), inverse depth (1); point 3.
struct FeatureState {
  FeatureId id = -1;
  FeatureKind kind = FeatureKind::kInverseDepth;
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
  int size() const { return kind == FeatureKind::kInverseDepth ? 6 : 3; }
  /// Position in the world (for inverse depth the mean's; far away as rho -> 0).
  Eigen::Vector3d position() const {
    return kind == FeatureKind::kPoint
               ? point_world
               : Eigen::Vector3d(anchor_world + bearing_world / inverse_depth);
  }
};

/// Order of a feature's error state, from its offset.
struct FeatureError {
  static constexpr int kAnchor = 0, kBearing = 3, kInverseDepth = 5, kPoint = 0;
};

}  // namespace active_matching_slam
