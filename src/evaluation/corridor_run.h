#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/evaluation/corridor_laps.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "corridor_world.h"

namespace active_matching_slam {

/// A camera on its way through the corridor: what it sees, what the filter makes of it
/// (corridor_run.cpp), and how the map is kept small (corridor_submaps.cpp).
class CorridorRun {
 public:
  CorridorRun(const CorridorOptions& options, std::uint64_t seed);
  CorridorResult run();

 private:
  static constexpr double kSpeed = 0.9, kRate = 10.0;  ///< [m/s], [Hz]
  static constexpr int kSeenToActivate = 10;           ///< points of a submap in view
  /// Of this thread.
  static double processorMs();

  double normal() { return normal_(random_); }
  double positionError() const {
    return (filter_.camera().position_world - truth_.translation()).norm();
  }

  /// What is in view, by point of the world.
  void look();
  void step();

  /// New points where few are in view: their directions as measured, their depths known relative
  /// to the scale of what is in the map, so that nothing is told of scale as such.
  void startPoints();

  /// How the mean logarithm of lengths in the map differs from the truth, and what it answers to.
  double relativeScale(Eigen::VectorXd* functional) const;
  void addPoints(const std::vector<int>& world_points);
  bool isResting(FeatureId id) const { return frame_ - last_seen_.at(id) >= options_.rest_frames; }

  /// The submap of which most is in view, if that is enough.
  bool activate();

  /// Whether the active map may take a submap and its separator; makes room if it can.
  bool hasRoom(int leaf);

  /// Whether three standard deviations of its place, seen from the camera, exceed a fifth of its
  /// distance.
  bool isFarOff(const Leaf& leaf) const;

  /// Keeps the active map small.
  void bound();
  void restSeparators();

  /// Submaps that were activated and of which hardly anything was measured go back as they were;
  /// of the others the points are free.
  void returnUntouched();
  void freezeOne();
  std::vector<FeatureId> separatorOf(const std::vector<FeatureId>& members, SubmapBorders borders,
                                     const FreezeOptions& options) const;

  /// What the same submap would lose by either separator.
  void compare(const std::vector<FeatureId>& members);
  void freeze(const std::vector<FeatureId>& members, const std::vector<FeatureId>& separator);

  /// From the one out of view for longest on, always the one with the strongest link to those taken
  /// (Prim's spanning tree): information of pairs given the camera.
  std::vector<FeatureId> linked(const std::vector<FeatureId>& candidates, int most) const;

  struct Activated {
    std::set<FeatureId> members;
    std::vector<FeatureId> separator;
    std::set<FeatureId> measured;
  };

  CorridorOptions options_;
  CorridorWorld world_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  CameraModel model_;
  std::unique_ptr<CameraModel> true_model_;
  Ekf filter_;
  EkfActiveMap active_;
  SubmapTree tree_;
  Eigen::Isometry3d truth_;
  int frame_ = 0, lap_ = 0, last_freeze_ = 0;
  bool loop_seen_ = false;
  std::map<int, Eigen::Vector2d> seen_;  ///< in view, by point of the world
  std::map<FeatureId, int> point_of_;    ///< of the world
  std::map<FeatureId, int> last_seen_;   ///< frame
  std::set<int> frozen_;                 ///< points of the world in trunk and leaves
  std::vector<Activated> activated_;
  std::vector<double> freeze_ms_, activate_ms_;
  CorridorResult result_;
};

}  // namespace active_matching_slam
