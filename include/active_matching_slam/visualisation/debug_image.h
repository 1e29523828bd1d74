#pragma once

#include <opencv2/core.hpp>

#include "active_matching_slam/tracker/tracked_frame.h"
#include "active_matching_slam/visualisation/draw_options.h"

namespace active_matching_slam {

/// The image with what the tracker made of it, 8-bit BGR; small images are enlarged by a whole
/// factor, and lines of text are added below. Full gates: green where a match was accepted, orange
/// where all were rejected, red where none was found, grey where none was looked for. Searched
/// ellipses run from cyan (first) to magenta (last); a red cross with the search's number stands
/// where a search found nothing. Dots are accepted matches, white for known points, diamonds the
/// best of the others. Submaps are those of `submap_level` (submapsAtLevel()). Empty when `frame`
/// has no image.
cv::Mat drawDebugImage(const TrackedFrame& frame, const DrawOptions& options, int submap_level);

}  // namespace active_matching_slam
