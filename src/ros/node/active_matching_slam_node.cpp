#include "active_matching_slam/math/blas_threads.h"
#include "active_matching_slam/math/freed_memory.h"
#include "active_matching_slam/ros/tracker_ros.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "active_matching_slam");
  active_matching_slam::useSingleThreadedBlas();
  active_matching_slam::keepFreedMemory();
  const ros::NodeHandle private_node("~");
  try {
    active_matching_slam::TrackerRos tracker(private_node);
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 2;
  }
  return 0;
}
