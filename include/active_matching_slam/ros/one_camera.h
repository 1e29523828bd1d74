#pragma once

#include <ros/time.h>
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

}  // namespace active_matching_slam
