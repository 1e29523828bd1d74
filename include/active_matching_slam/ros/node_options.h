#pragma once

#include <string>

#include "active_matching_slam/math/option_field.h"
#include "active_matching_slam/visualisation/draw_options.h"

namespace active_matching_slam {

/// Settings of the ROS side; those of the tracker itself are TrackerOptions.
struct NodeOptions {
  std::string image_transport = "raw";
  std::string camera_info_url;
  std::string known_target;
  std::string mask_file;
  std::string first_map;
  std::string data_directory;
  std::string tf_mode = "camera";
  std::string world_frame = "world";
  std::string camera_frame;
  std::string base_frame;
  std::string odom_frame = "odom";
  std::string map_frame;
  double transform_tolerance_s = 0.1;
  double tf_timeout_s = 0.05;
  double no_image_timeout_s = 5.0;
  int path_length = 3000;
  int trajectory_length = 200000;
  int submap_level = 2;
  DrawOptions draw;

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void NodeOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("image_transport", "", "raw, compressed, theora or any other installed")
            .atStartOnly(),
        o.image_transport);
  visit(basicOption("camera_info_url", "",
                    "calibration used until a camera_info arrives (file:// or package://)")
            .atStartOnly(),
        o.camera_info_url);
  visit(basicOption("known_target", "",
                    "yaml file of what makes lengths metric: points to start from, a tag or a "
                    "chessboard; empty: scale free")
            .atStartOnly(),
        o.known_target);
  visit(basicOption("mask_file", "",
                    "picture of the images' size: only where it is white images are used (~mask "
                    "takes its place)")
            .atStartOnly(),
        o.mask_file);
  visit(basicOption("first_map", "", "map to begin with, a file in data_directory; empty: none")
            .atStartOnly(),
        o.first_map);
  visit(basicOption("data_directory", "",
                    "where maps and trajectories live; empty: ~/.ros/active_matching_slam")
            .atStartOnly(),
        o.data_directory);
  visit(basicOption("tf_mode", "", "camera (world to camera), map_to_odom (REP 105) or none")
            .atStartOnly(),
        o.tf_mode);
  visit(basicOption("world_frame", "", "frame of the map of features").atStartOnly(),
        o.world_frame);
  visit(basicOption("camera_frame", "", "optical frame of the camera; empty: what the images say")
            .atStartOnly(),
        o.camera_frame);
  visit(basicOption("base_frame", "",
                    "body frame whose pose tf and ~odometry give, found through tf; empty: the "
                    "camera's own")
            .atStartOnly(),
        o.base_frame);
  visit(basicOption("odom_frame", "", "tf_mode map_to_odom: child of the transform sent")
            .atStartOnly(),
        o.odom_frame);
  visit(basicOption("map_frame", "",
                    "frame with z up (REP 103) above world_frame, by a static transform; empty: "
                    "none. tf_mode map_to_odom needs it")
            .atStartOnly(),
        o.map_frame);
  visit(basicOption("no_image_timeout_s", "s", "silence after which missing images are reported"),
        o.no_image_timeout_s, 0.5, 3600.0);
  visit(basicOption("path_length", "", "poses in ~path"), o.path_length, 1, 100000);
  visit(basicOption("submap_level", "", "level of the hierarchy that colours map and markers"),
        o.submap_level, 0, 30);
  visit(advancedOption("trajectory_length", "", "poses kept for ~save_trajectory").atStartOnly(),
        o.trajectory_length, 1, 10000000);
  visit(advancedOption("transform_tolerance_s", "s", "how far map_to_odom is dated ahead"),
        o.transform_tolerance_s, 0.0, 10.0);
  visit(advancedOption("tf_timeout_s", "s", "longest wait for the robot's own transforms"),
        o.tf_timeout_s, 0.0, 5.0);
  visitOptions(o.draw, visit);
}

/// Throws std::invalid_argument naming the option: ranges, tf_mode, frames that are equal or
/// missing.
void checkNodeOptions(const NodeOptions& options);

}  // namespace active_matching_slam
