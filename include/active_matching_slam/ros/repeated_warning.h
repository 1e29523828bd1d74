#pragma once

#include <ros/ros.h>

#include <string>

namespace active_matching_slam {

/// A warning that may hold for every image: logged at once, and again only after a while of real
/// time. (The macros of rosconsole that do this share their clock between all trackers of a
/// process.)
class RepeatedWarning {
 public:
  /// `cause`: what makes two warnings the same; another cause is logged at once.
  void say(const std::string& cause, const std::string& text) {
    const ros::WallTime now = ros::WallTime::now();
    if (cause == cause_ && (now - said_).toSec() < kPeriod_s) return;
    cause_ = cause;
    said_ = now;
    ROS_WARN_STREAM(text);
  }
  void say(const std::string& text) { say(text, text); }

 private:
  static constexpr double kPeriod_s = 5.0;
  std::string cause_;
  ros::WallTime said_;
};

}  // namespace active_matching_slam
