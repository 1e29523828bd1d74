#pragma once

#include <optional>

#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

struct ChosenReading {
  Bundle bundle;
  /// By how much more the next one costs, in what is asked of it; infinite: there is no other.
  double lead = 0.0;
};

/// The reading of the images that is clearly the best, by some of them: `believed`, the first
/// time also a camera that only turned, one of these with near and far exchanged, and the first
/// time readingsByDirection(). Empty when in doubt.
std::optional<ChosenReading> bestReading(const CameraModel& model, const BundleOptions& options,
                                         const Bundle& believed, bool is_first);

/// Whether things move or matches lie, by the cost that `bundle` was adjusted to.
bool costsTooMuch(double cost, const Bundle& bundle);

/// Standard deviation [px], per axis, of the image points as what they miss of the projections
/// shows it, by the median over features, so that the few that are wrong don't count.
double noiseOf(const CameraModel& model, const Bundle& bundle);

}  // namespace active_matching_slam
