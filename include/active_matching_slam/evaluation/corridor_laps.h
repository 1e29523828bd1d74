#pragma once

#include <cstdint>
#include <vector>

#include "active_matching_slam/submaps/submap_tree.h"

namespace active_matching_slam {

/// How a map is kept small.
enum class MapBound {
  kNone,    ///< not at all: the whole map in one filter
  kDelete,  ///< what is out of view for longest is deleted
  kSubmaps  ///< it is frozen in submaps, which are activated when they are seen again
};

/// Where submaps are cut.
enum class SubmapBorders {
  kInformation,  ///< members by mutual information given the camera, separator by information
  kNaive         ///< the oldest, of which the newest are the separator
};

/// Laps of a camera through a corridor, a loop of 58 m, past points that are known by number: no
/// images and no wrong matches; the filter and the tree of submaps are those of the package.
struct CorridorOptions {
  double laps = 2.12;
  double sigma_px = 0.5;  ///< of the measurements
  int measured = 40;      ///< features in a frame at most; new ones start when fewer are in view
  int points = 1500;      ///< in the world
  MapBound bound = MapBound::kSubmaps;
  SubmapBorders borders = SubmapBorders::kInformation;
  int maximum_features = 120;  ///< of the active map
  int leaf_minimum = 20;       ///< points of a submap, its separator not counted
  int leaf_maximum = 40;
  int rest_frames = 15;  ///< so long a point must be out of view before it is frozen
  FreezeOptions freeze;
  /// Compares, whenever a submap is frozen, the bits that are lost with this many separators by
  /// information and with the naive ones; 0: no.
  int compared_separators = 0;
};

struct LapSummary {
  double nees = 0.0;  ///< mean, of position and rotation: 6 is right
  double nees_median = 0.0;
  double error_m = 0.0;   ///< mean error of the position
  double frame_ms = 0.0;  ///< median processor time of a frame
  int points = 0;         ///< held at its end, active, trunk and leaves
  int trunk = 0, leaves = 0;
  int active_most = 0;  ///< largest active map of any frame
};

/// Bits that one submap would lose with as many separators of either kind.
struct ComparedBits {
  int lap = 0;
  double information_bits = 0.0, naive_bits = 0.0;
};

struct CorridorResult {
  std::vector<LapSummary> laps;        ///< complete ones, and the rest
  std::vector<double> lost_bits;       ///< of each submap that was frozen
  std::vector<int> frozen_in_lap;      ///< when
  std::vector<ComparedBits> compared;  ///< with CorridorOptions::compared_separators
  /// Error of the position before and after the frame that first saw the beginning again [m].
  double error_before_loop_m = 0.0, error_after_loop_m = 0.0;
  double freeze_ms = 0.0, activate_ms = 0.0;  ///< medians, processor time
  bool healthy = true;                        ///< no update was refused
};

/// Deterministic in its seed, durations apart.
CorridorResult runCorridorLaps(const CorridorOptions& options, std::uint64_t seed);

}  // namespace active_matching_slam
