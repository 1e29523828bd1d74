#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/image/target_detector.h"
#include "active_matching_slam/information/requested_submaps.h"
#include "active_matching_slam/initialisation/initialiser_options.h"
#include "active_matching_slam/map/map_options.h"
#include "active_matching_slam/map/relocaliser_options.h"
#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/math/option_field.h"
#include "active_matching_slam/tracker/ground_plane.h"
#include "active_matching_slam/submaps/submap_filter_options.h"
#include "active_matching_slam/tracker/match_cascade_options.h"
#include "active_matching_slam/tracker/motion_options.h"

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
  bool mapping = true;  ///< false: the camera is found and followed in a map that stays as loaded
  FilterOptions filter;
  ImageOptions image;
  MapOptions map;
  MatchOptions matching = liveMatchOptions();
  MatchCascadeOptions cascade;
  SubmapOptions submaps;
  SubmapFilterOptions submap_filter;
  InitialiserOptions initialisation;
  RelocaliserOptions relocaliser;
  MotionOptions motion;
  GroundOptions ground;
  std::vector<KnownPoint> known_points;  ///< empty: scale free, world = first camera frame
  TargetDescription target;  ///< looked for while scale is free; its size makes the map metric
  double known_points_search_px = 15.0;    ///< how far each may lie from its image_px
  double known_points_sigma_m = 5e-4;      ///< of their positions, per axis
  double max_frame_interval_s = 0.5;       ///< after a longer gap the whole image is searched first
  int lost_after_frames = 15;              ///< consecutive frames with too few matches
  int minimum_matches = 4;                 ///< fewer is 'too few'
  double new_map_when_lost_after_s = 1.0;  ///< the old one is kept and looked for; 0: never
  double reset_when_lost_after_s = 0.0;    ///< give up the map that was lost; 0: never
  bool learn_rates = true;                 ///< of each feature's true and false matches
  bool fallback_matchers = true;           ///< where few match, see MatchCascade
  bool structure = false;                  ///< maintain the MI graph and the submaps
  /// What the graph's mutual information expects of the camera from one image to the next. (Search
  /// regions allow for jerks too, and a jerk turns: that moves near and far alike, and hides the
  /// differences between them.)
  Accelerations structure_accelerations = {4.0, 3.0};

  /// Its own options, and after them those of the rooms below.
  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void TrackerOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("matcher", "",
                    "active_search, jcbb, one_point_ransac, active, fast_active, chow_liu or auto"),
        o.matcher);
  visit(basicOption("mapping", "", "false: follow the camera in a loaded map, which stays as it is")
            .atStartOnly(),
        o.mapping);
  visit(basicOption("fallback_matchers", "",
                    "when far fewer match than should, match again by the motion of the whole "
                    "image, jcbb, one_point_ransac"),
        o.fallback_matchers);
  visit(basicOption("structure", "", "maintain the graph of mutual information and the submaps"),
        o.structure);
  visit(
      basicOption("known_points_search_px", "px", "how far a known point may lie from its image_px")
          .atStartOnly(),
      o.known_points_search_px, 1.0, 200.0);
  visit(basicOption("known_points_sigma_m", "m",
                    "accuracy of the known points' positions, standard deviation per axis")
            .atStartOnly(),
        o.known_points_sigma_m, 1e-6, 1.0);
  visit(basicOption("lost_after_frames", "",
                    "frames with too few matches in a row until the camera is lost"),
        o.lost_after_frames, 1, 10000);
  visit(basicOption("new_map_when_lost_after_s", "s",
                    "begin a new map when lost for so long, and look for the old one on the side; "
                    "0: never"),
        o.new_map_when_lost_after_s, 0.0, 1e6);
  visit(basicOption("reset_when_lost_after_s", "s",
                    "give up a map that was lost so long ago; 0: keep looking for it"),
        o.reset_when_lost_after_s, 0.0, 1e6);
  visit(advancedOption("minimum_matches", "", "fewer matches in a frame are too few"),
        o.minimum_matches, 1, 1000);
  visit(advancedOption("max_frame_interval_s", "s",
                       "after a longer gap between stamps the whole image is searched for the map "
                       "first"),
        o.max_frame_interval_s, 0.01, 3600.0);
  visit(advancedOption("learn_rates", "",
                       "learn how often each feature is matched rightly and wrongly"),
        o.learn_rates);
  visit(advancedOption("structure_acceleration_mps2", "m/s^2",
                       "what the graph of mutual information expects of the camera: linear "
                       "acceleration, standard deviation per axis"),
        o.structure_accelerations.linear_mps2, 0.0, 1e3);
  visit(advancedOption("structure_angular_acceleration_rps2", "rad/s^2",
                       "the same, angular; the less, the more near and far come apart"),
        o.structure_accelerations.angular_rps2, 0.0, 1e3);
  visitOptions(o.motion, visit);
  visitOptions(o.ground, visit);
  visitOptions(o.filter, visit);
  visitOptions(o.image, visit);
  visitOptions(o.map, visit);
  visitOptions(o.matching, visit);
  visitOptions(o.cascade, visit);
  visitOptions(o.submap_filter, visit);
  visitOptions(o.submaps, visit);
  visitOptions(o.initialisation, visit);
  visitOptions(o.relocaliser, visit);
}

/// Throws std::invalid_argument with name, value and what is allowed.
void checkTrackerOptions(const TrackerOptions& options);

/// Reads a known_target into `known_points` or `target`: kind: tag (dictionary, id, size_m), kind:
/// chessboard (columns, rows, square_m), or kind: points, as readKnownPointsYaml(), which may be
/// left out. Throws std::runtime_error naming file and field.
void readKnownTargetYaml(const std::string& path, TrackerOptions* options);

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
