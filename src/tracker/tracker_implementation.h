#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "active_matching_slam/filter/match_noise.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/information/map_structure.h"
#include "active_matching_slam/initialisation/initialiser.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/map/map_monitor.h"
#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// A look through the whole map takes long.
constexpr int kFramesBetweenLooks = 4;

/// What a Tracker does, stage by stage. The stages stand in files of their own: tracker.cpp (the
/// way of a frame), tracker_start.cpp, tracker_match.cpp, tracker_map.cpp, tracker_lost.cpp and
/// tracked_frame.cpp.
class Tracker::Implementation {
 public:
  Implementation(const CameraModel& camera, const TrackerOptions& options)
      : camera_(camera),
        options_(options),
        filter_(withTrustIn(camera.calibration(), options.filter)),
        search_(options.image),
        second_search_(options.image),
        relocaliser_({}, options.map, options.image),
        matcher_(createMatcher(options.matcher)),
        consensus_matcher_(createMatcher("one_point_ransac")),
        longest_matcher_(createMatcher("jcbb")) {
    checkTrackerOptions(options);
  }

  std::shared_ptr<const TrackedFrame> track(const cv::Mat& image, double stamp_s);
  void reset(const std::string& reason);
  void setOptions(const TrackerOptions& options);
  void setScale(double factor);
  void saveMap(const std::string& path) const;
  void loadMap(const std::string& path);

  const TrackerOptions& options() const { return options_; }

 private:
  bool accept(const cv::Mat& image, double stamp_s, TrackedFrame* frame);
  void start(const cv::Mat& image, TrackedFrame* frame);
  bool startFromKnownPoints(const cv::Mat& image, TrackedFrame* frame);
  bool initialise(const cv::Mat& image, TrackedFrame* frame);
  void follow(const cv::Mat& image, TrackedFrame* frame);
  void predict(double interval_s);
  void measure(const cv::Mat& image);
  bool askToo(Matcher& matcher, const MeasurementPrior& prior, ImageFeatureSearch& search,
              double share, double least, double chi2_per_degree, TrackedFrame* frame);
  std::optional<MeasurementPrior> guidedPrior(const cv::Mat& image) const;
  MatchOptions partOfBudget(double share) const;
  double expectedOf(const MatchStatistics& s) const;
  bool isByChance(const MatchResult& result, double expected) const;
  void match(const cv::Mat& image, TrackedFrame* frame);
  void learnNoise(const UpdateReport& report);
  void correct(const cv::Mat& image, TrackedFrame* frame);
  bool giveUpWrongMap(const cv::Mat& image, TrackedFrame* frame);
  void judge();
  void lose(const std::string& reason);
  void relocalise(const cv::Mat& image, TrackedFrame* frame);
  bool findInMap(const cv::Mat& image, TrackedFrame* frame);
  void maintainMap(const cv::Mat& image, TrackedFrame* frame);
  void observeStructure();
  void updateStructure(TrackedFrame* frame);
  int startFeatures(const cv::Mat& image, int wanted, TrackedFrame* frame);
  void retire(const std::vector<FeatureId>& ids, TrackedFrame* frame);
  struct DepthSample {
    Eigen::Vector3d bearing_camera;
    double inverse_depth;
  };
  std::vector<DepthSample> knownDepths() const;
  double depthPrior(const Eigen::Vector2d& pixel, std::vector<DepthSample> known) const;
  void describe(TrackedFrame* frame) const;

  CameraModel camera_;
  TrackerOptions options_;
  Ekf filter_;
  MatchNoise match_noise_;
  Initialiser initialiser_;
  FeatureMap map_;
  MapMonitor map_monitor_;
  ImageFeatureSearch search_, second_search_;
  Relocaliser relocaliser_;
  std::unique_ptr<Matcher> matcher_;
  std::unique_ptr<Matcher> consensus_matcher_, longest_matcher_;  ///< second opinions
  MapStructure structure_;
  MapStructure::Snapshot structure_snapshot_;

  TrackingState state_ = TrackingState::kWaiting;
  std::string reason_;
  ScaleSource scale_source_ = ScaleSource::kFree;
  cv::Mat previous_image_;
  /// The last image in which enough was matched, and its camera.
  cv::Mat image_before_;
  Eigen::Isometry3d T_world_camera_before_ = Eigen::Isometry3d::Identity();
  double last_stamp_s_ = 0.0;   ///< of the last image accepted
  double state_stamp_s_ = 0.0;  ///< of the filter's state
  double interval_s_ = 0.0;     ///< from the state before to this
  double lost_stamp_s_ = 0.0;   ///< when the camera was lost
  std::int64_t images_ = 0;
  int resets_ = 0, times_lost_ = 0, poor_frames_ = 0;

  // The frame in hand.
  std::vector<VisibleFeature> visible_, candidates_;
  MeasurementPrior prior_;
  std::vector<Template> templates_;
  std::vector<FeatureMeasurement> fused_;
};

}  // namespace active_matching_slam
