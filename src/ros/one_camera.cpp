#include "active_matching_slam/ros/one_camera.h"

#include <cmath>

#include "active_matching_slam/ros/image_conversions.h"

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

bool OneCalibration::take(const sensor_msgs::CameraInfoConstPtr& info, double now_s) {
  if (in_use_ && sameCalibration(*in_use_, *info)) {
    in_use_came_s_ = now_s;
    return true;
  }
  const bool by_turns = other_ && sameCalibration(*other_, *info) &&
                        now_s - in_use_came_s_ < kPatience_s && now_s - other_came_s_ < kPatience_s;
  if (by_turns) {
    other_came_s_ = now_s;
    return false;
  }
  other_ = in_use_;
  other_came_s_ = in_use_came_s_;
  in_use_ = info;
  in_use_came_s_ = now_s;
  return true;
}

}  // namespace active_matching_slam
