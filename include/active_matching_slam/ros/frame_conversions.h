#pragma once

#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/ColorRGBA.h>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "active_matching_slam/ros/messages.h"
#include "active_matching_slam/tracker/tracked_frame.h"
#include "active_matching_slam/visualisation/submap_view.h"

namespace active_matching_slam {

// From a TrackedFrame to messages. `header`: the image's stamp with the frame that the message's
// definition names. What is not finite is never written: such features are left out of arrays and
// clouds, and such numbers become zero.

ams_msgs::TrackingState toTrackingStateMsg(const TrackedFrame& frame,
                                           const std_msgs::Header& header);
ams_msgs::FeatureArray toFeatureArrayMsg(const TrackedFrame& frame, int submap_level,
                                         const std_msgs::Header& header);
ams_msgs::MatchingStatistics toStatisticsMsg(const TrackedFrame& frame,
                                             std::uint64_t dropped_images,
                                             const std_msgs::Header& header);
ams_msgs::MatchHypotheses toHypothesesMsg(const TrackedFrame& frame,
                                          const std_msgs::Header& header);
/// Empty when the frame has no graph (no hierarchy).
ams_msgs::MutualInformationGraph toGraphMsg(const TrackedFrame& frame,
                                            const std_msgs::Header& header);
ams_msgs::SubmapHierarchy toSubmapsMsg(const TrackedFrame& frame, const std_msgs::Header& header);

/// Fields x y z, sigma (largest standard deviation of the position [m]), id, submap, rgb.
sensor_msgs::PointCloud2 toPointCloudMsg(const TrackedFrame& frame, int submap_level,
                                         const std_msgs::Header& header);

/// True when position and covariance can be shown: finite, and not further than `limit_m`.
bool isShowable(const TrackedFeature& feature, double limit_m = 1e6);

/// submapRgb(), opaque.
std_msgs::ColorRGBA submapColor(int submap);

}  // namespace active_matching_slam
