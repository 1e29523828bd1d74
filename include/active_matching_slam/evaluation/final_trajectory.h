#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <unordered_map>
#include <vector>

#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// Where the camera was in the map as it ends. A filter corrects its map and the present camera;
/// the poses that it gave before stay as they were, and so keep the drift that a loop has taken out
/// of the map since. Here each frame keeps the directions to the features that it matched; in the
/// end its pose is the one from which these features, where they are now, are seen in these
/// directions (resection, as of the motion alone in a bundle adjustment). Where the map has not
/// changed, the pose is what it was.
class FinalTrajectory {
 public:
  void add(const TrackedFrame& frame);
  /// Of the frames tracked in the map of the last frame, in their order. Made when first asked for.
  const Trajectory& poses() const;

 private:
  struct Sighting {
    FeatureId id;
    Eigen::Vector3f direction_camera;  ///< unit
  };
  struct Frame {
    StampedPose pose;
    std::vector<Sighting> sightings;
  };
  std::vector<Frame> frames_;
  std::unordered_map<FeatureId, Eigen::Vector3d> positions_;  ///< in the last frame
  int map_ = -1;
  std::vector<std::size_t> loops_;  ///< frames before each that was closed and not taken back
  mutable std::optional<Trajectory> poses_;  ///< since the last frame was added
};

/// The camera that sees `points` in `directions` (unit, camera's frame), from near `start`: least
/// squares of the angles, those that are off by far weighed down (Huber). Empty where there are too
/// few, or they do not tell.
std::optional<Eigen::Isometry3d> resect(const std::vector<Eigen::Vector3d>& points,
                                        const std::vector<Eigen::Vector3d>& directions,
                                        const Eigen::Isometry3d& start);

}  // namespace active_matching_slam
