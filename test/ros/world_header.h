#pragma once

#include <std_msgs/Header.h>

namespace active_matching_slam {

/// Of what is published in the frame "world".
inline std_msgs::Header worldHeader() {
  std_msgs::Header header;
  header.frame_id = "world";
  header.stamp = ros::Time(3, 4);
  return header;
}

}  // namespace active_matching_slam
