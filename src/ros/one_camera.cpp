#include "active_matching_slam/ros/one_camera.h"

#include <cmath>

namespace active_matching_slam {
namespace {

/// Another camera is followed after so long without the one before, in either direction of time.
/// Cost: so long a driver that comes back under another name is not listened to [s].
constexpr double kPatience_s = 1.0;

}  // namespace

std::string OneCamera::faultOf(const std_msgs::Header& header, const std::string& publisher) {
  const std::string camera =
      "frame_id '" + header.frame_id + "'" + (publisher.empty() ? "" : " by " + publisher);
  if (followed_.empty() || std::abs(header.stamp.toSec() - last_.toSec()) > kPatience_s)
    followed_ = camera;
  if (camera != followed_)
    return "two cameras on one topic: followed is that of " + followed_ + "; left out: " + camera;
  last_ = header.stamp;
  return "";
}

}  // namespace active_matching_slam
