#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/image_mask.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/matching/match_result.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// The frame in hand: made when the filter's state has been predicted to its stamp, passed from
/// stage to stage, each of which adds what it finds out.
struct FrameState {
  explicit FrameState(const ImageOptions& options) : search(options) {}

  // From the prediction.
  cv::Mat image;                           ///< with what is not used in plain grey
  ImageMask mask;                          ///< which part of it is used
  double interval_s = 0.0;                 ///< since the filter's state before
  double predicted_interval_s = 0.0;       ///< of that, what the motion was predicted over
  int poor_frames = 0;                     ///< frames just before this one with too few matches
  bool depths_vague = false;               ///< all features were seen from about one place so far
  std::vector<VisibleFeature> visible;     ///< all that should be seen, ascending id
  std::vector<FeatureId> behind_mask;      ///< that should be seen in what is not used, ascending
  std::vector<double> visible_bits;        ///< of each, what a search should tell of the camera
  std::vector<double> visible_state_bits;  ///< ... and of the whole state
  double bits_left = 0.0;  ///< what the next best one would have told that was not chosen

  // Of each feature chosen to be measured, in the order of `prior`.
  std::vector<VisibleFeature> candidates;
  std::vector<Template> templates;
  std::vector<TemplateSource> sources;      ///< of these
  std::vector<double> match_probabilities;  ///< by the feature's recent record
  /// Where it was in `reference_image`; empty where it was not in view.
  std::vector<std::optional<Eigen::Vector2d>> reference_px;
  std::vector<char> in_reference;  ///< whether it was matched there: what is hidden has no flow
  MeasurementPrior prior;
  /// 2F x any: what a jerk, an acceleration as wide as the options expect, adds to the prior's S is
  /// this times its transpose.
  Eigen::MatrixXd jerk_px;
  double jerk_probability = 0.0;
  /// The same of what the prior would have been without a measurement of the motion (odometry,
  /// gyroscope); without columns where there was none.
  Eigen::MatrixXd unmeasured_px;
  /// The last image with enough matches, whose camera is known. Empty when there is none.
  cv::Mat reference_image;

  // From the matching.
  ImageFeatureSearch search;  ///< the match indices of `matching` point into it
  MatchResult matching;
  bool is_jerk = false;  ///< matched only when a jerk was allowed for: `prior` does
  /// Entries of `prior` whose accepted match passes the innovation gate, ascending.
  std::vector<int> inliers;

  // From the update.
  std::vector<FeatureMeasurement> measurements;  ///< those of the inliers, as fused

  bool isLookedFor(int entry) const { return search.searchedPixels(entry).size() > 0; }
  int countLookedFor() const {
    int count = 0;
    for (int i = 0; i < prior.size(); ++i) count += isLookedFor(i);
    return count;
  }
};

}  // namespace active_matching_slam
