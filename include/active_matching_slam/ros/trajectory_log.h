#pragma once

#include <nav_msgs/Path.h>

#include <Eigen/Geometry>
#include <deque>
#include <string>
#include <vector>

#include "active_matching_slam/ros/markers.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// The poses claimed since the last reset, bounded: the oldest go first.
class TrajectoryLog {
 public:
  explicit TrajectoryLog(int maximum_poses) : maximum_poses_(maximum_poses) {}

  void add(const TrackedFrame& frame);
  void clear() { poses_.clear(); }
  std::size_t size() const { return poses_.size(); }
  /// After the map's scale changed; what was written before keeps its own.
  void rescale(double factor);

  /// The last `length` poses.
  nav_msgs::Path path(int length, const std_msgs::Header& header) const;
  std::vector<TrajectoryPoint> points(int length) const;

  /// Writes TUM lines (stamp, position, quaternion x y z w of T_world_camera); the file appears
  /// complete or not at all. Throws std::runtime_error naming file and cause.
  void save(const std::string& path) const;

 private:
  struct Pose {
    double stamp_s;
    Eigen::Vector3d position_world;
    Eigen::Quaterniond q_world_camera;
    Eigen::Matrix3d position_covariance;
  };
  std::deque<Pose>::const_iterator lastPoses(int length) const;

  int maximum_poses_;
  std::deque<Pose> poses_;
};

}  // namespace active_matching_slam
