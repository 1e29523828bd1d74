#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// Semi-axes [px] of a 3-sigma ellipse, longer first: 3 times the roots of the eigenvalues; and the
/// direction of the longer one, from u towards v [deg].
struct EllipseAxes {
  double major_px = 0.0, minor_px = 0.0, angle_deg = 0.0;
};
EllipseAxes threeSigmaEllipse(const Eigen::Matrix2d& covariance_px2);

/// The image with what the tracker made of it, 8-bit BGR; small images are enlarged by a whole
/// factor. Green: accepted match, orange: rejected one, red: searched in vain, blue: not searched;
/// searched ellipses run from violet (first) over green to yellow (last). Submaps are those of
/// `submap_level` (submapsAtLevel()). Empty when `frame` has no image.
cv::Mat drawDebugImage(const TrackedFrame& frame, const DrawOptions& options, int submap_level);

}  // namespace active_matching_slam
