#pragma once

#include <string>

#include "active_matching_slam/tracker/option_fields.h"
#include "active_matching_slam/visualisation/draw_options.h"

namespace active_matching_slam {

/// Settings of the ROS side; those of the tracker itself are TrackerOptions.
struct NodeOptions {
  std::string image_transport = "raw";
  std::string camera_info_url;
  std::string known_target;
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
};

/// As visitOptions(): the single description of these settings.
template <class Options, class Visitor>
void visitNodeOptions(Options& o, Visitor&& visit) {
  using F = OptionField;
  visit(F{"image_transport", "raw, compressed, theora or any other installed", false},
        o.image_transport);
  visit(F{"camera_info_url", "calibration used until a camera_info arrives (file:// or package://)",
          false},
        o.camera_info_url);
  visit(F{"known_target",
          "yaml file with points of known position to start from; empty: scale free", false},
        o.known_target);
  visit(F{"data_directory", "where maps and trajectories live; empty: ~/.ros/active_matching_slam",
          false},
        o.data_directory);
  visit(F{"tf_mode", "camera (world to camera), map_to_odom (REP 105) or none", false}, o.tf_mode);
  visit(F{"world_frame", "frame of the map of features", false}, o.world_frame);
  visit(F{"camera_frame", "optical frame of the camera; empty: what the images say", false},
        o.camera_frame);
  visit(F{"base_frame",
          "body frame whose pose tf and ~odometry give, found through tf; empty: the "
          "camera's own",
          false},
        o.base_frame);
  visit(F{"odom_frame", "tf_mode map_to_odom: child of the transform sent", false}, o.odom_frame);
  visit(F{"map_frame",
          "frame with z up (REP 103) above world_frame, by a static transform; empty: "
          "none. tf_mode map_to_odom needs it",
          false},
        o.map_frame);
  visit(F{"transform_tolerance_s", "how far map_to_odom is dated ahead [s]", true},
        o.transform_tolerance_s, 0.0, 10.0);
  visit(F{"tf_timeout_s", "longest wait for the robot's own transforms [s]", true}, o.tf_timeout_s,
        0.0, 5.0);
  visit(F{"no_image_timeout_s", "silence after which missing images are reported [s]", true},
        o.no_image_timeout_s, 0.5, 3600.0);
  visit(F{"path_length", "poses in ~path", true}, o.path_length, 1, 100000);
  visit(F{"trajectory_length", "poses kept for ~save_trajectory", false}, o.trajectory_length, 1,
        10000000);
  visit(F{"submap_level", "level of the hierarchy that colours map and markers", true},
        o.submap_level, 0, 30);
  visit(F{"draw/predictions", "predicted 3-sigma ellipses in ~debug_image", true},
        o.draw.predictions);
  visit(F{"draw/searches", "searched ellipses in ~debug_image, coloured first to last", true},
        o.draw.searches);
  visit(F{"draw/matches", "matches, accepted and not, and searches that found nothing", true},
        o.draw.matches);
  visit(F{"draw/templates", "the features' patches at the lower border", true}, o.draw.templates);
  visit(F{"draw/information", "mutual information beside each candidate [bit]", true},
        o.draw.information);
  visit(F{"draw/tree", "links of the Chow-Liu tree in ~debug_image", true}, o.draw.tree);
  visit(
      F{"draw/links", "links of mutual information between visible features in ~debug_image", true},
      o.draw.links);
  visit(
      F{"draw/submaps", "features and tree in the colours of their submaps in ~debug_image", true},
      o.draw.submaps);
  visit(F{"draw/status", "a line of text below ~debug_image", true}, o.draw.status);
  visit(F{"draw/legend", "what the marks mean, below ~debug_image", true}, o.draw.legend);
  visit(F{"draw/frustum_m", "length of the camera's frustum in ~markers/camera [m]", true},
        o.draw.frustum_m, 1e-3, 1e3);
  visit(F{"draw/minimum_link_bits",
          "weaker links are left out of ~markers/mutual_information and ~debug_image [bit]", true},
        o.draw.minimum_link_bits, 0.0, 100.0);
  visit(F{"draw/links_per_feature",
          "largest number of links shown of each feature, the strongest; the tree's besides", true},
        o.draw.links_per_feature, 0, 10000);
}

/// Throws std::invalid_argument naming the setting: ranges, tf_mode, frames that are equal or
/// missing.
void checkNodeOptions(const NodeOptions& options);

}  // namespace active_matching_slam
