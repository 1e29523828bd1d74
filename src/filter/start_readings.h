#pragma once

#include <optional>

#include "active_matching_slam/filter/bundle_adjustment.h"

namespace active_matching_slam {

/// The reading of the images that is clearly the best, by some of them: `believed`, a camera that
/// only turned, or one of these with near and far exchanged. Empty when in doubt.
std::optional<Bundle> bestReading(const CameraModel& model, const BundleOptions& options,
                                  const Bundle& believed);

/// Standard deviation [px], per axis, of the image points as what they miss of the projections
/// shows it, by the median over features, so that the few that are wrong don't count.
double noiseOf(const CameraModel& model, const Bundle& bundle);

}  // namespace active_matching_slam
