#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// What is known of a camera that a robot carries over flat ground.
struct GroundOptions {
  double camera_height_m = 0.0;
  double camera_pitch_deg = 0.0;
  double tilt_sigma_deg = 1.0;
  double unevenness = 0.03;

  bool isKnown() const { return camera_height_m > 0.0; }
  /// Of the camera on a robot that stands level, in the camera's axes; unit.
  Eigen::Vector3d downCamera() const;

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void GroundOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("camera_height_m", "m",
                    "height of the camera above the ground that a robot drives on, which makes the "
                    "map metric; 0: not known"),
        o.camera_height_m, 0.0, 100.0);
  visit(advancedOption("ground/camera_pitch_deg", "deg",
                       "how far the camera looks down on a robot that stands level; where odometry "
                       "comes, tf says it instead"),
        o.camera_pitch_deg, -80.0, 80.0);
  visit(advancedOption("ground/tilt_sigma_deg", "deg",
                       "how well that is known while the robot drives, and that it looks level to "
                       "the sides, standard deviation"),
        o.tilt_sigma_deg, 0.01, 20.0);
  visit(advancedOption("ground/unevenness", "",
                       "of the ground, standard deviation, by the camera's height above it"),
        o.unevenness, 0.001, 0.3);
}

/// A point of the map, seen from the camera, in its axes; lengths in map units.
struct PointBelow {
  Eigen::Vector3d position_camera;
  Eigen::Matrix3d covariance;  ///< of it, relative to the camera
};

/// A plane on which the robot is taken to stand.
struct GroundPlane {
  Eigen::Vector3d down_camera;  ///< its normal
  double height = 0.0;          ///< of the camera over it [map units]
  double relative_sigma = 0.0;  ///< of the height
  int points = 0, points_below = 0;
};

/// The plane with the most points on it and the fewest below, whose normal is `down_camera` as well
/// as that is known. Each point in turn proposes the height at which it would lie on the ground
/// (RANSAC with as much known beforehand that one point makes a hypothesis, Civera et al. 2010,
/// taken exhaustively: nothing is random); the best is adjusted by least squares over the points on
/// it, with the direction as a prior. None where that is no ground: too few points on it, or too
/// many below.
std::optional<GroundPlane> findGround(const std::vector<PointBelow>& points,
                                      const Eigen::Vector3d& down_camera,
                                      const GroundOptions& options);

}  // namespace active_matching_slam
