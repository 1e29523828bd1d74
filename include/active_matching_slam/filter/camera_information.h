#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {

/// The search for a feature as a measurement of the camera.
struct CameraMeasurement {
  /// z = W c + n, n ~ N(0, I), c ~ N(0, I) the camera (position, rotation, both velocities) in
  /// units of its own standard deviations: W = chol(S_z|c)^-1 P_zc chol(P_c)^-T with P the
  /// covariance of the state, P_zc = H P_:c and S_z|c = H P H^T + R - P_zc P_c^-1 P_cz: what the
  /// feature's own position is uncertain by counts as noise.
  Eigen::Matrix<double, 2, 12> W;
  /// What it tells of the feature once the camera is known [bit], 1/2 log2(|S_z|c| / |R|). With
  /// what it tells of the camera that makes what it tells of the state (Chli 2009, eq. 4.28).
  double own_bits = 0.0;
  double gate_area_px2 = 0.0;  ///< of the 3-sigma ellipse
};

/// Of each feature by itself. Of the whole camera, not its pose alone: what the map and the camera
/// have drifted by together no match can tell, and in the pose it soon exceeds all else. Empty for
/// a feature that does not project. `sigmas_px`: noise per axis, of each.
std::vector<std::optional<CameraMeasurement>> measurementsOfCamera(
    const Ekf& filter, const CameraModel& camera, const std::vector<FeatureId>& ids,
    const std::vector<double>& sigmas_px);

}  // namespace active_matching_slam
