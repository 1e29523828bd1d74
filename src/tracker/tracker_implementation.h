#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "active_matching_slam/filter/motion_noise.h"
#include "active_matching_slam/image/image_fixed_parts.h"
#include "active_matching_slam/image/target_detector.h"
#include "active_matching_slam/image/working_size.h"
#include "active_matching_slam/information/map_structure.h"
#include "active_matching_slam/initialisation/initialiser.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/map/map_monitor.h"
#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/tracker/frame_state.h"
#include "active_matching_slam/tracker/ground_plane.h"
#include "active_matching_slam/tracker/match_cascade.h"
#include "active_matching_slam/tracker/motion_history.h"
#include "active_matching_slam/tracker/scale_finder.h"
#include "active_matching_slam/tracker/tracker.h"
#include "active_matching_slam/tracker/tracking_quality.h"
#include "frame_noise.h"
#include "loop_finder.h"
#include "map_joiner.h"
#include "submap_keeper.h"

namespace active_matching_slam {

/// Frames with too few matches after which the camera is looked for. Cost: until then it may come
/// back by itself, and a look takes half of a frame's time.
constexpr int kRelocalisationPeriodFrames = 4;
/// A stamp that runs back by less is a late image; by more, the time is another [s]. Cost: with a
/// clock that was set back no image is taken for so long.
constexpr double kClockStep_s = 1.0;

/// What a Tracker does, stage by stage. The stages stand in files of their own: tracker.cpp (the
/// way of a frame), tracker_start.cpp, tracker_match.cpp, tracker_map.cpp, tracker_submaps.cpp,
/// tracker_lost.cpp, tracker_look.cpp and tracked_frame.cpp. What is known of the frame in hand is
/// passed from one to the next (FrameState); members hold what lasts.
class Tracker::Implementation {
 public:
  Implementation(const CameraModel& camera, const TrackerOptions& options)
      : working_(camera.calibration(), options.image.working_width),
        camera_(working_.isReduced() ? CameraModel(working_.calibration()) : camera),
        options_(options),
        filter_(withTrustIn(camera_.calibration(), options.filter)),
        noise_(options.filter),
        motion_noise_(options.filter),
        cascade_(options.matcher, options.cascade),
        relocaliser_(options.relocaliser, options.map, options.image),
        submaps_(options.submap_filter) {
    checkTrackerOptions(options);
    if (options.motion.hasGyro()) filter_.estimateGyroBias(options.motion.gyro_bias_sigma_rps);
  }

  std::shared_ptr<const TrackedFrame> track(const cv::Mat& image, double stamp_s,
                                            const std::string& fault);
  void reset(const std::string& reason);
  void setOptions(const TrackerOptions& options);
  void setScale(double factor);
  void saveMap(const std::string& path) const;
  void loadMap(const std::string& path);
  void setMask(const cv::Mat& used);
  void setMotionHistory(std::shared_ptr<const MotionHistory> history) {
    motion_history_ = std::move(history);
  }
  void setPose(const Eigen::Isometry3d& T_world_camera,
               const Eigen::Matrix<double, 6, 6>& covariance);

  const TrackerOptions& options() const { return options_; }

 private:
  bool accept(const cv::Mat& image, double stamp_s, const std::string& why_empty,
              TrackedFrame* frame);
  void start(const cv::Mat& image, TrackedFrame* frame);
  bool startFromKnownPoints(const cv::Mat& image, TrackedFrame* frame);
  bool initialise(const FrameState& current, TrackedFrame* frame);
  FrameState follow(const cv::Mat& image, double interval_s, TrackedFrame* frame);
  void predict(double interval_s);
  void measureMotion();
  bool isMetric() const;
  bool isTranslationKnown() const { return motion_ && motion_->velocity_start; }
  bool isPoseKnown() const;
  Eigen::Matrix<double, 6, 1> widestImpulse() const;
  void learnMotion(const UpdateReport& report, const Accelerations& allowed, bool is_jerk);
  bool areDepthsKnown() const;
  bool canBecomeMetric();
  void findScale(TrackedFrame* frame);
  std::vector<PointBelow> pointsAround() const;
  void scaleByGround(TrackedFrame* frame);
  void becomeMetric(double factor, double relative_sigma, ScaleSource source, TrackedFrame* frame);
  void rescale(double factor);
  FrameState measure(const cv::Mat& image, double interval_s) const;
  std::vector<VisibleFeature> visibleFeatures(std::vector<FeatureId>* behind_mask = nullptr) const;
  void chooseCandidates(FrameState* current) const;
  void predictMeasurements(FrameState* current) const;
  void correct(FrameState* current, TrackedFrame* frame);
  static std::vector<FeatureMeasurement> selectMeasurements(const FrameState& current);
  void learnSlopes(const FrameState& current);
  void recordSearches(const FrameState& current, std::int64_t index);
  void judgeQuality(const FrameState& current);
  bool giveUpWrongMap(const FrameState& current, TrackedFrame* frame);
  void updateTrackingState(const FrameState& current);
  void lose(const std::string& reason);
  void lookForCamera(const std::string& reason);
  void relocaliseWhileLost(const cv::Mat& image, double interval_s, TrackedFrame* frame);
  void placeCamera(const Relocalisation& found, TrackedFrame* frame);
  bool beginNewMap(const cv::Mat& image, TrackedFrame* frame);
  void forgetOldMaps();
  void abandonMap(const std::string& reason);
  void clearMap();
  bool findNearGivenPose(const cv::Mat& image, double interval_s, TrackedFrame* frame);
  Corrected corrected() const { return options_.mapping ? Corrected::kAll : Corrected::kCamera; }
  void rescaleBesideFilter(double factor);
  void followTarget(const cv::Mat& image, TrackedFrame* frame);
  void addTarget(const cv::Mat& image, TrackedFrame* frame);
  void scaleByTarget(TrackedFrame* frame);
  void maintainMap(const cv::Mat& image, TrackedFrame* frame);
  void observeStructure(const std::vector<VisibleFeature>& visible);
  void updateStructure(TrackedFrame* frame);
  std::vector<FeatureId> leastInformative(int count) const;
  int mostFeatures() const;
  void keepSubmaps(const TrackedFrame& frame);
  std::vector<Eigen::Vector2d> frozenPixels() const;
  void lookForLoop(const cv::Mat& image, double interval_s, TrackedFrame* frame);
  void closeLoop(int submap, const Relocalisation& found, const CameraOffset& offset,
                 TrackedFrame* frame);
  bool watchLoop(TrackedFrame* frame);
  bool leaveOutImageFixed(const FrameState& current, TrackedFrame* frame);
  void retakePatches(const FrameState& current);
  void leaveOutTrial(FrameState* current);
  std::vector<Eigen::Vector2d> occupiedPixels() const;
  int startFeatures(const cv::Mat& image, const std::vector<VisibleFeature>& visible, int wanted,
                    TrackedFrame* frame);
  void retire(const std::vector<FeatureId>& ids, TrackedFrame* frame);
  struct DepthSample {
    Eigen::Vector3d bearing_camera;
    double inverse_depth;
  };
  std::vector<DepthSample> knownDepths(const std::vector<VisibleFeature>& visible) const;
  FeatureId addFeature(const Eigen::Vector2d& pixel, const SourcePatch& patch,
                       const std::vector<DepthSample>& known_depths, std::int64_t index);
  double depthPrior(const Eigen::Vector2d& pixel, std::vector<DepthSample> known) const;
  void describeState(TrackedFrame* frame) const;
  static void describeMatches(FrameState current, TrackedFrame* frame);

  /// Corners of options_.target that are features of a map.
  struct TargetCorner {
    FeatureId id;
    Eigen::Vector2d pixel, position_m;  ///< where it was seen first, and in the target's plane
  };
  struct Target {
    int map = -1;
    std::vector<TargetCorner> corners;
    bool is_taken = false;  ///< its size is the unit, for good
    double sigma_px = 0.0;  ///< of their pixels, per axis
  };

  /// All that is kept of a map while the camera is in another.
  struct LostMap {
    int number;
    double lost_stamp_s;
    Ekf filter;
    FrameNoise noise;
    FeatureMap map;
    MapMonitor monitor;
    ScaleSource scale_source;
    SubmapKeeper submaps;
  };
  /// All that closing a loop changed, as it was before, and how images have fared since.
  struct LoopUndo {
    Ekf filter;
    FeatureMap map;
    SubmapKeeper submaps;
    int images;
    double nis;
    int degrees;
  };
  void takeBack(LoopUndo undo);

  /// Where the camera is looked for.
  struct Place {
    enum class Kind { kMap, kSubmap, kLostMap };
    Kind kind;
    int number;  ///< of the submap or of the lost map
  };
  /// A look for the camera that goes on over some frames.
  struct OngoingLook {
    enum class Purpose { kLost, kLoop, kOtherMap };
    Purpose purpose;
    CameraLook look;
    std::vector<Place> places;  ///< not empty; the last is looked at first
    double stamp_s;
    Eigen::Isometry3d T_world_camera;  ///< where the camera was taken to be, in the map in hand
  };
  /// A camera that was found in an image of before.
  struct Sighting {
    Place place;
    Relocalisation found;
    cv::Mat image;
    double stamp_s;
    Eigen::Isometry3d T_world_camera;  ///< as in OngoingLook
    int images = 0;                    ///< in which it was looked for near there
  };
  enum class LookBudget { kWhole, kHalf, kQuarter };

  double lookMilliseconds(LookBudget share, double interval_s) const;
  void beginLook(OngoingLook::Purpose purpose, const cv::Mat& image, std::vector<Place> places);
  void endLook();
  void endPlace();
  std::vector<Landmark> landmarksOf(const Place& place) const;
  std::optional<Eigen::Isometry3d> continueLook(double milliseconds, double* spent_ms);
  std::optional<Sighting> proveLook(double milliseconds);
  std::vector<Place> placesWhileLost();
  bool lookWhileLost(const cv::Mat& image, LookBudget share, double interval_s,
                     TrackedFrame* frame);
  std::optional<Relocalisation> findNear(const Sighting& sighting, const cv::Mat& image,
                                         double interval_s);
  void goOnIn(const Place& place, const Relocalisation& found, TrackedFrame* frame);
  void enterPlace(const Place& place);
  UpdateReport relocateByInliers(const Relocalisation& found, Ekf* filter) const;
  bool lookForOtherMaps(const cv::Mat& image, double interval_s, TrackedFrame* frame);
  bool confirmOtherMap(const cv::Mat& image, TrackedFrame* frame);
  bool joinMaps(const Place& place, const Relocalisation& found, TrackedFrame* frame);
  void takeFeatures(const Ekf& other, const FeatureMap& other_map, const UnitRatio& unit);
  int lostMapIndex(int number) const;

  LostMap storeMap();
  void takeMap(LostMap stored);

  WorkingSize working_;
  CameraModel camera_;  ///< of images of the working size
  TrackerOptions options_;
  ImageMask mask_;
  ImageFixedParts image_fixed_;
  Ekf filter_;
  FrameNoise noise_;
  MotionNoise motion_noise_;
  TrackingQuality quality_;
  Initialiser initialiser_;
  FeatureMap map_;
  MapMonitor map_monitor_;
  std::shared_ptr<const MotionHistory> motion_history_;
  /// Of the interval to the image in hand, as it was fused; the camera's displacement is left out
  /// while the map is not metric, and kept for the scale.
  std::optional<MotionMeasurement> motion_;
  std::optional<UncertainVector> unscaled_velocity_;
  MotionReport motion_report_;
  std::string motion_fault_;
  double predicted_interval_s_ = 0.0;
  ScaleFinder scale_finder_;
  Target target_;
  MatchCascade cascade_;
  Relocaliser relocaliser_;
  SubmapKeeper submaps_;
  LoopWitness loop_witness_;
  std::optional<LoopUndo> loop_undo_;
  int loops_ = 0, map_epoch_ = 0;
  MapStructure structure_;
  MapStructure::Snapshot structure_snapshot_;

  std::vector<LostMap> lost_maps_;  ///< the one that was lost last at the end
  double last_look_stamp_s_ = 0.0;  ///< when they were looked for
  std::optional<OngoingLook> look_;
  std::optional<Sighting> sighting_;  ///< to be confirmed in the next image
  int map_number_ = 0, maps_begun_ = 1;
  bool awaits_loaded_map_ =
      false;  ///< the camera has not been found yet in the map that was loaded

  TrackingState state_ = TrackingState::kWaiting;
  std::string reason_;
  ScaleSource scale_source_ = ScaleSource::kFree;
  std::string scale_fault_;
  cv::Mat previous_image_;
  /// The last image with enough matches, and its camera.
  cv::Mat reference_image_;
  std::int64_t reference_index_ = -1;  ///< of that image
  Eigen::Isometry3d T_world_reference_ = Eigen::Isometry3d::Identity();
  double last_stamp_s_ = 0.0;   ///< of the last image accepted
  double state_stamp_s_ = 0.0;  ///< of the filter's state
  double lost_stamp_s_ = 0.0;   ///< when the camera was lost
  std::int64_t images_ = 0;
  int resets_ = 0, times_lost_ = 0, jumps_ = 0, late_images_ = 0;
  int unrelated_images_ = 0;    ///< in a row, each of which became the first of a map
  bool is_pose_given_ = false;  ///< lost, but the filter's camera is where setPose() put it
  int poor_frames_ = 0;         ///< with too few matches, in a row
};

}  // namespace active_matching_slam
