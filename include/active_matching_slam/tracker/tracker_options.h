#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/map/map_options.h"
#include "active_matching_slam/matching/match_options.h"

namespace active_matching_slam {

/// A point of known position that the tracker starts from.
struct KnownPoint {
  Eigen::Vector3d position_m;  ///< in the target's frame, which becomes the world
  Eigen::Vector2d image_px;    ///< roughly where it is seen in the first image
  cv::Mat template_image;      ///< optional 8-bit grey template, centre = the point
};

/// Matching for live use: stops asking for information that no longer pays, and bounds the mixture
/// and the time.
inline MatchOptions liveMatchOptions() {
  MatchOptions options;
  options.latch_information_bits = 0.1;
  options.max_gaussians = 50;
  options.max_milliseconds = 20.0;
  options.modelled_time = true;
  options.merge_sigmas = 0.5;
  options.ambiguous_below_weight = 0.3;
  options.default_rates.true_positive = 0.8;
  return options;
}

/// All settings of a Tracker.
struct TrackerOptions {
  std::string matcher = "auto";
  FilterOptions filter;
  ImageOptions image;
  MapOptions map;
  MatchOptions matching = liveMatchOptions();
  std::vector<KnownPoint> known_points;  ///< empty: scale free, world = first camera frame
  double known_points_search_px = 15.0;  ///< how far each may lie from its image_px
  double known_points_sigma_m = 5e-4;    ///< of their positions, per axis
  double max_frame_interval_s = 0.5;     ///< after a longer gap the whole image is searched first
  int lost_after_frames = 15;            ///< consecutive frames with too few matches
  int minimum_matches = 4;               ///< fewer is 'too few'
  double new_map_when_lost_after_s = 1.0;  ///< the old one is kept and looked for; 0: never
  double reset_when_lost_after_s = 0.0;  ///< give up the map that was lost; 0: never
  bool learn_rates = true;               ///< of each feature's true and false matches
  bool fallback_matchers = true;         ///< where few match, see MatchCascade
  bool structure = false;                ///< maintain the MI graph and the submaps
  /// What the graph's mutual information expects of the camera from one image to the next. (Search
  /// regions allow for jerks too, and a jerk turns: that moves near and far alike, and hides the
  /// differences between them.)
  Accelerations structure_accelerations = {4.0, 3.0};
};

/// Throws std::invalid_argument with name, value and allowed range.
void checkTrackerOptions(const TrackerOptions& options);

/// Reads known_target.yaml: points: [{position_m: [x, y, z], image_px: [u, v], template:
/// file.png}]. Template paths are relative to the yaml file. Throws std::runtime_error naming file
/// and field.
std::vector<KnownPoint> readKnownPointsYaml(const std::string& path);

/// Reads settings from a yaml file of the shape of config/tracker.yaml over `defaults`. An unknown
/// key or a value out of range throws std::invalid_argument naming it.
TrackerOptions readTrackerOptionsYaml(const std::string& path, const TrackerOptions& defaults = {});

/// Sets one setting from text of the form "matching/prune_weight=0.01". Throws
/// std::invalid_argument naming an unknown setting, a wrong type or a value out of range.
void setTrackerOption(const std::string& assignment, TrackerOptions* options);

}  // namespace active_matching_slam
