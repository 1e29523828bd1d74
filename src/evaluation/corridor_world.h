#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"

namespace active_matching_slam {

/// A corridor round a block of rooms, 20 m by 10 m along its middle, with points on its walls,
/// floor and ceiling and in rooms beside it. The world is the frame of the first camera.
class CorridorWorld {
 public:
  CorridorWorld(int points, std::uint64_t seed);

  const std::vector<Eigen::Vector3d>& points() const { return points_; }
  static double lapLength();
  /// The camera, in the hand of one who has walked so far [m] and for so long.
  Eigen::Isometry3d camera(double walked_m, double time_s) const;
  /// Where a camera sees a point; empty when it does not, a wall between them included.
  std::optional<Eigen::Vector2d> project(const CameraModel& model,
                                         const Eigen::Isometry3d& T_world_camera, int point) const;

 private:
  struct Wave {
    double amplitude, omega, phase;
  };
  struct Room {
    Eigen::Vector2d low, high;
  };
  double sway(int axis, double time_s) const;
  bool isOpen(const Eigen::Vector2d& place) const;
  Eigen::Isometry3d cameraInBuilding(double walked_m, double time_s) const;

  std::vector<Wave> waves_[6];
  std::vector<Room> rooms_;
  std::vector<Eigen::Vector3d> in_building_;  ///< x, y in the plan, z up
  std::vector<Eigen::Vector3d> points_;
  Eigen::Isometry3d T_building_world_;
};

}  // namespace active_matching_slam
