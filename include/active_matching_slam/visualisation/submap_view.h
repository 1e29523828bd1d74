#pragma once

#include <vector>

#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// Submap of each entry of frame.features: of the partition that was asked for (SubmapOptions), or
/// else at `level` of the hierarchy, the last when there are fewer. -1 where there is none, or no
/// hierarchy.
std::vector<int> submapsAtLevel(const TrackedFrame& frame, int level);

}  // namespace active_matching_slam
