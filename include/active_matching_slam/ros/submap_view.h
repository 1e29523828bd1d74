#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

// What image, cloud and markers share when they show submaps. Free of ROS.

/// Submap of each entry of frame.features at `level` of the hierarchy (the last level when there
/// are fewer; -1 where there is none, or no hierarchy).
std::vector<int> submapsAtLevel(const TrackedFrame& frame, int level);

/// Distinct colour for a submap label, red, green, blue in 0 to 1; grey for none (-1). Same label,
/// same colour, always.
Eigen::Vector3f submapRgb(int submap);

}  // namespace active_matching_slam
