#include <pluginlib/class_list_macros.hpp>

#include "active_matching_slam/rviz_panel/tracker_panel.h"

PLUGINLIB_EXPORT_CLASS(active_matching_slam::TrackerPanel, rviz::Panel)
