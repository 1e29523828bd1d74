#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/matching/match_result.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

enum class TrackingState {
  kWaiting,       ///< no image accepted yet
  kInitialising,  ///< looking for the known target, or for the first features
  kTracking,
  kLost  ///< no pose is claimed; searching for the map in the whole image
};
std::string trackingStateName(TrackingState state);

/// The numbers are those of files and messages.
enum class ScaleSource {
  kFree = 0,
  kKnownTarget = 1,
  kKnownPoints = 2,
  kService = 3,
  kOdometry = 4,
  kTag = 5,
  kChessboard = 6,
  kCameraHeight = 7
};
std::string scaleSourceName(ScaleSource source);

/// What became of a feature in this frame.
enum class FeatureStatus {
  kNotVisible,  ///< outside the image, masked, behind, or too different a view of it than the first
  /// Predicted visible but not chosen, or the budget ended first, or no match met where not all of
  /// its gate could be searched, for the mask.
  kNotSearched,
  kMissed,    ///< searched, no match met
  kRejected,  ///< a match was met but not accepted
  kMatched
};
std::string featureStatusName(FeatureStatus status);

/// A feature as anyone may publish, draw, log or test it.
struct TrackedFeature {
  FeatureId id = -1;
  FeatureKind kind = FeatureKind::kInverseDepth;
  Eigen::Vector3d position_world;
  Eigen::Matrix3d covariance_world;  ///< first order
  Eigen::Vector3d anchor_world;      ///< kInverseDepth: the ray and its depth
  Eigen::Vector3d bearing_world;
  double inverse_depth = 0.0;
  double sigma_inverse_depth = 0.0;
  FeatureStatus status = FeatureStatus::kNotVisible;
  bool known = false;                         ///< from the known target or known points
  Eigen::Vector2d predicted_px;               ///< valid unless kNotVisible
  Eigen::Matrix2d innovation_covariance_px2;  ///< prior S_ii; valid unless kNotVisible
  Eigen::Vector2d matched_px;                 ///< kMatched (and kRejected: the best match met)
  double score = 0.0;                         ///< ZNCC of the match
  FeatureRates rates;                         ///< Ptp and Pfp, as learnt so far
  double gate_sigma_px = 0.0;                 ///< noise per axis that its match is allowed
  /// Expected of its search, by itself; 0 for kNotVisible: what it tells of the camera, and of the
  /// whole state (Chli 2009, eq. 4.28) [bit].
  double camera_bits = 0.0, state_bits = 0.0;
  int attempts = 0;        ///< frames searched since it was started
  int successes = 0;       ///< frames matched
  cv::Mat template_image;  ///< 8-bit source patch at first sight
};

/// A feature that has left the active map and is kept.
struct FrozenFeature {
  FeatureId id = -1;
  int submap = -1;            ///< the leaf that holds it; -1: the trunk
  bool is_separator = false;  ///< of a leaf
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
};

/// A submap that has left the active map.
struct FrozenSubmap {
  int id = -1;
  int features = 0, separators = 0;
  double lost_bits = 0.0;  ///< by its links to the rest, but for its separators, when it was cut
};

/// What has left the active map and is kept, as submaps (SubmapTree).
struct FrozenMap {
  std::vector<FrozenFeature> features;       ///< ascending id
  std::vector<FeatureId> active_separators;  ///< of leaves, in the active map; ascending
  std::vector<FrozenSubmap> leaves;          ///< ascending id
  int submaps = 0;                           ///< leaves
  int trunk_features = 0;
  double lost_bits = 0.0;     ///< by the leaves' links to the rest that were cut, their sum
  int frozen = 0, found = 0;  ///< leaves so far, and how often one was found again
};

/// Time spent in each stage of a frame [ms].
struct FrameTimings {
  double predict = 0, measure = 0, match = 0, update = 0, map = 0, structure = 0, total = 0;
};

/// Everything there is to know about one processed image. Immutable once returned.
struct TrackedFrame {
  double stamp_s = 0.0;
  std::int64_t index = 0;  ///< counts images given to the tracker since construction
  TrackingState state = TrackingState::kWaiting;
  std::string reason;           ///< why the state is what it is; empty while all is well
  bool repeated_image = false;  ///< identical to the one before: no new information was fused
  ScaleSource scale_source = ScaleSource::kFree;

  /// Relative standard deviation of lengths as a whole; 0: not known, or scale is free.
  double scale_sigma = 0.0;
  /// Why what should have made lengths metric was not used; empty: nothing was refused.
  std::string scale_fault;
  /// By what all lengths of the map were multiplied in this frame, as its scale became known: those
  /// of frames before it count times so much.
  double rescaled_by = 1.0;
  /// What besides the images has told of the motion since the last one: odometry, gyro or nothing;
  /// and what was wrong with it, empty: nothing.
  std::string motion_source, motion_fault;

  CameraState camera;
  /// 12 x 12, CameraError order (world-frame additive position, world-frame rotation vector, ...).
  MotionCovariance camera_covariance = MotionCovariance::Zero();
  double match_sigma_px = 0.0;  ///< noise per axis of most matches; 0: none were searched
  Accelerations accelerations;  ///< expected of the camera, as learnt so far
  double nis = 0.0;
  int nis_degrees = 0;
  /// What the image told of the camera (position, rotation, both velocities), 1/2 log2 |P| before
  /// over after [bit].
  double camera_bits = 0.0;
  /// What the best of the visible features would have told of the state that was not chosen; 0:
  /// none was left [bit].
  double state_bits_left = 0.0;

  std::vector<TrackedFeature> features;
  std::vector<std::vector<SearchMatch>> matches;  ///< all matches met, per entry of `prior`
  MatchResult matching;
  /// What the matcher was given, so that a frame can be matched again: the prediction, and one
  /// template for each of its entries. Empty when nothing was predicted.
  MeasurementPrior prior;
  std::vector<Template> templates;
  int features_started = 0, features_retired = 0, features_converted = 0;
  int features_failed = 0;  ///< of those retired: their matches failed, or drifted off
  std::int64_t retired_total = 0;
  int resets = 0;  ///< resets since construction
  int times_lost = 0;
  /// Which map the pose is in: each has a world, and a unit of length, of its own. Numbers of maps
  /// that were begun, from 0 on.
  int map = 0;
  /// Whether the poses can be trusted, 0 to 1, and the likely cause where they can't.
  double quality = 1.0;
  std::string quality_reason;
  std::shared_ptr<const FrozenMap> frozen;  ///< null unless submaps/enabled
  int loops = 0;      ///< closed since construction: places found again though the map had drifted
  int map_epoch = 0;  ///< so often since construction a loop moved map and camera
  /// In such a frame: the camera after the correction, times the inverse of the one before.
  Eigen::Isometry3d map_jump = Eigen::Isometry3d::Identity();
  int jumps = 0;        ///< so often since construction the pose did not go on from the one before
  int late_images = 0;  ///< left out since construction: taken before one that came earlier

  std::shared_ptr<const MutualInformationGraph> graph;  ///< null unless asked for
  std::shared_ptr<const SubmapHierarchy> submaps;       ///< null unless asked for

  /// 8-bit grey, as tracked (shared, not to be written to): of the working size, see
  /// ImageOptions::working_width. All pixels are of this image.
  cv::Mat image;
  cv::Mat mask;  ///< 0 where the image was not used; empty: all of it was
  /// Share of the image that turned out to be fixed to it, and no part of the scene (text that is
  /// burnt in, dirt, the robot itself): as if masked.
  double image_fixed = 0.0;
  FrameTimings timings_ms;
};

/// That so much of images is no scene; empty for 0.
std::string imageFixedMessage(double share);

/// KL divergence of the tree that chow_liu matched by from the joint prediction [bit]; 0 for
/// another matcher. O(F^3), and so no part of the frame.
double treeDivergenceBits(const TrackedFrame& frame);

/// `camera_bits` for each millisecond that measuring, matching and the update took; 0 when unknown.
double cameraBitsPerMillisecond(const TrackedFrame& frame);

/// I(z_i; all others) in the prediction (Chli 2009, eq. 4.31), by feature [bit]. Costs O(F^3) and
/// is rarely needed: so it is no part of the frame.
std::unordered_map<FeatureId, double> predictedInformationBits(const TrackedFrame& frame);

}  // namespace active_matching_slam
