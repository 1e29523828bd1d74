#pragma once

#include <Eigen/Core>
#include <optional>

#include "active_matching_slam/filter/motion_measurement.h"

namespace active_matching_slam {

/// Finds the unit of length of a map of free scale: the ratio of how far the camera has gone by
/// odometry and in it, over stretches that are each long enough to stand out of errors.
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
  /// Whose errors a stretch has to stand out of. For the scale the map's: the odometry has no say
  /// in where stretches end, which its errors would, one way. To compare directions the
  /// odometry's, which are the larger.
  enum class Judge { kMap, kOdometry };
  struct Ways {
    UncertainVector in_map, by_odometry;  ///< of the stretch in hand
    /// Over the stretches: products of the two ways without what their errors add to them, and
    /// what the errors of each make of their product.
    double map_map = 0.0, map_odometry = 0.0, odometry_odometry = 0.0;
    double by_map_errors = 0.0, by_odometry_errors = 0.0;

    void add(const UncertainVector& map_step, const UncertainVector& odometry_step, Judge judge);
    double relativeVariance(double m_per_map_unit) const;
  };

  Ways for_scale_, for_direction_;
};

}  // namespace active_matching_slam
