#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/submaps/conditional.h"

namespace active_matching_slam {

/// How the camera that a submap shows lies to the one that is predicted: position and rotation in
/// CameraError order, from the predicted one, in the world.
struct CameraOffset {
  Eigen::Matrix<double, 6, 1> offset = Eigen::Matrix<double, 6, 1>::Zero();
  /// Of the predicted camera in relation to the submap as a rigid body, and of the camera found.
  Eigen::Matrix<double, 6, 6> predicted = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> found = Eigen::Matrix<double, 6, 6>::Zero();
  /// offset^T (predicted + found)^-1 offset; 6 degrees of freedom. Infinite where that is singular.
  double squared = 0.0;
  /// Whether that is within what chance explains.
  bool isExpected() const;
  /// Whether a drift explains it that is some times larger than the filter knows; else the submap
  /// is of a place that only looks the same.
  bool isPossible() const;
};

/// `points`: of a submap, given the active map (SubmapTree::givenActive()). `found`: the camera as
/// its landmarks, at the means of `points`, show it.
CameraOffset offsetFromSubmap(const Ekf& filter, const CameraModel& camera,
                              const Conditional& points, const Relocalisation& found);

/// Widens what is known of camera and `carried` features (ascending ids), moved together as a rigid
/// body about the camera, by `added`.
void loosenCamera(const Eigen::Matrix<double, 6, 6>& added, const std::vector<FeatureId>& carried,
                  Ekf* filter);

/// Remembers cameras that were found where chance does not explain them: a drift that the filter
/// knows nothing of looks the same in another image, a mistake does not.
class LoopWitness {
 public:
  void clear() { looks_.clear(); }
  /// Whether an earlier image says the same; else it is remembered, if it is possible at all.
  /// `T_world_camera`: predicted.
  bool confirms(std::int64_t image, const Eigen::Isometry3d& T_world_camera,
                const Relocalisation& found, const CameraOffset& offset);

 private:
  struct Look {
    std::int64_t image;
    Eigen::Isometry3d T_old_new;  ///< from the world of the prediction to that of the submap
    Eigen::Matrix<double, 6, 6> covariance;
  };
  std::vector<Look> looks_;
};

}  // namespace active_matching_slam
