#pragma once

#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

/// Readings to begin an adjustment from: for each direction of the last camera's move that explains
/// its image better than those around it, the few best first, cameras on a line and depths as the
/// image has them. `turned`: cameras that only turned, features at `options.inverse_depth`. In the
/// first images the cost of a bundle has several valleys, and from no move an adjustment finds one.
/// For a given direction, the turn and what is left are those of the epipolar constraint (Heeger &
/// Jepson 1992), without depths.
std::vector<Bundle> readingsByDirection(const CameraModel& model, const BundleOptions& options,
                                        const Bundle& turned);

}  // namespace active_matching_slam
