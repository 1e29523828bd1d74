#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "active_matching_slam/evaluation/trajectory.h"

namespace active_matching_slam {

/// Which transform may bring an estimate onto the truth before they are compared.
enum class AlignmentKind {
  kRigid,      ///< SE(3): rotation and translation
  kSimilarity  ///< Sim(3): and one scale
};

/// x_truth = scale * R x_estimate + t.
struct Alignment {
  double scale = 1.0;
  Eigen::Matrix3d rotation_truth_estimate = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& position_estimate) const {
    return scale * (rotation_truth_estimate * position_estimate) + translation;
  }
  Eigen::Isometry3d operator()(const Eigen::Isometry3d& T_world_camera_estimate) const;
};

/// Least-squares alignment of the positions (Umeyama, PAMI 1991). Empty when it is not determined:
/// fewer than three pairs, positions that are not finite, or (kSimilarity) an estimate or a truth
/// that does not move. Motion along a line leaves the roll about that line free: any is returned.
std::optional<Alignment> align(const std::vector<PosePair>& pairs, AlignmentKind kind);

/// Root mean square distance of positions after `alignment`: the absolute trajectory error (ATE).
/// NaN without pairs.
double absoluteTrajectoryError(const std::vector<PosePair>& pairs, const Alignment& alignment);

/// Relative pose error: how wrong the motion over a fixed time is, whatever came before.
struct RelativePoseError {
  double translation_rmse = 0.0;  ///< [m]
  double rotation_rmse_rad = 0.0;
  int intervals = 0;
};

/// The motion from each pair to the one nearest to `interval_s` later (within a tenth of it) is
/// compared with the truth's, the estimated translation first multiplied by `scale`: 1 for a metric
/// estimate, that of the Sim(3) alignment where scale is free. Empty when no interval is that long.
std::optional<RelativePoseError> relativePoseError(const std::vector<PosePair>& pairs,
                                                   double interval_s = 1.0, double scale = 1.0);

}  // namespace active_matching_slam
