#pragma once

#include <Eigen/Core>
#include <optional>

#include "active_matching_slam/filter/motion_measurement.h"

namespace active_matching_slam {

/// Finds the unit of length of a map of free scale: the ratio of how far the camera has gone in it
/// and by odometry, from where both began to be added up.
class ScaleFinder {
 public:
  struct Scale {
    double map_units_per_m, relative_sigma;
  };

  void reset() { *this = ScaleFinder(); }
  /// One interval's displacement, in the world, in map units and in metres.
  void add(const UncertainVector& in_map, const UncertainVector& by_odometry);
  /// None until it is known well enough to be linear in what is left of its error.
  std::optional<Scale> scale() const;
  /// The two have gone so far that they should agree on where to, and do not.
  bool isContradicted() const;

 private:
  UncertainVector in_map_, by_odometry_;
};

}  // namespace active_matching_slam
