#pragma once

#include <ros/ros.h>

#include <algorithm>
#include <cstring>
#include <set>
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

/// Warnings of faults that go on for long: each kind is logged once. What differs in its numbers
/// alone is of one kind.
class OnceWarning {
 public:
  void say(const std::string& text) {
    if (said_.insert(kindOf(text)).second) ROS_WARN_STREAM(text);
  }
  bool hasSaid() const { return !said_.empty(); }
  /// All is well, or begins anew: whatever comes is said again.
  void forget() { said_.clear(); }

 private:
  static std::string kindOf(std::string text) {
    const auto is_of_number = [](char c) { return std::strchr("0123456789.+-e", c) != nullptr; };
    text.erase(std::remove_if(text.begin(), text.end(), is_of_number), text.end());
    return text;
  }

  std::set<std::string> said_;
};

}  // namespace active_matching_slam
