#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <std_msgs/Header.h>

#include <string>

namespace active_matching_slam {

/// Follows one camera where several publish on one topic: that of the first image, until for a
/// while no image of it has come.
class OneCamera {
 public:
  /// Empty when an image with this header is of the camera that is followed; else why it is left
  /// out. `publisher`: its node, where that is known.
  std::string faultOf(const std_msgs::Header& header, const std::string& publisher = "");

 private:
  std::string followed_;
  ros::Time last_;
};

/// Follows one calibration where those of several cameras come by turns on one topic.
class OneCalibration {
 public:
  /// False when `info` is left out: it came by turns with the one in use. `now_s`: of one clock
  /// that goes on.
  bool take(const sensor_msgs::CameraInfoConstPtr& info, double now_s);
  /// The same pointer for as long as the calibration is the same; null before the first.
  const sensor_msgs::CameraInfoConstPtr& inUse() const { return in_use_; }

 private:
  sensor_msgs::CameraInfoConstPtr in_use_, other_;
  double in_use_came_s_ = 0.0, other_came_s_ = 0.0;
};

}  // namespace active_matching_slam
