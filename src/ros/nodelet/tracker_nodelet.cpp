#include <nodelet/nodelet.h>

#include <pluginlib/class_list_macros.hpp>

#include "active_matching_slam/ros/tracker_ros.h"

namespace active_matching_slam {

/// TrackerRos inside a nodelet manager.
class TrackerNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      tracker_ = std::make_unique<TrackerRos>(getPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(error.what());
      throw;  // the manager answers that loading failed
    }
  }
  std::unique_ptr<TrackerRos> tracker_;
};

}  // namespace active_matching_slam

PLUGINLIB_EXPORT_CLASS(active_matching_slam::TrackerNodelet, nodelet::Nodelet)
