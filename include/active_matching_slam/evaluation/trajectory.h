#pragma once

#include <Eigen/Geometry>
#include <string>
#include <utility>
#include <vector>

namespace active_matching_slam {

/// Where a camera was at a time: camera points into the world [m or map units].
struct StampedPose {
  double stamp_s = 0.0;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};
using Trajectory = std::vector<StampedPose>;

/// Reads TUM text: "stamp tx ty tz qx qy qz qw" a line (the scalar part of the quaternion last),
/// '#' begins a comment. Quaternions are normalised. Throws std::runtime_error naming file and
/// line.
Trajectory readTrajectoryTum(const std::string& path);

/// Writes TUM text. Throws std::runtime_error naming the file.
void writeTrajectoryTum(const std::string& path, const Trajectory& trajectory);
std::string trajectoryTumText(const Trajectory& trajectory);

/// An estimated pose and the true one of the same moment.
struct PosePair {
  double stamp_s = 0.0;  ///< of the estimate
  Eigen::Isometry3d T_world_camera_estimate = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_world_camera_truth = Eigen::Isometry3d::Identity();
};

/// Pairs of indices (estimate, truth) of poses that are each other's nearest in time and at most
/// `maximum_difference_s` apart, by ascending stamp. Either may be the denser one and in any order;
/// no pose is used twice; between equally near ones the earlier wins.
std::vector<std::pair<int, int>> associateByStamp(const Trajectory& estimate,
                                                  const Trajectory& truth,
                                                  double maximum_difference_s = 0.02);
std::vector<PosePair> pairPoses(const Trajectory& estimate, const Trajectory& truth,
                                double maximum_difference_s = 0.02);

/// How far a trajectory goes.
struct Excursion {
  double displacement = 0.0;  ///< between the first and the last position
  double excursion = 0.0;     ///< largest distance from the first position
  double path_length = 0.0;   ///< sum over the steps
};
Excursion measureExcursion(const Trajectory& trajectory);

}  // namespace active_matching_slam
