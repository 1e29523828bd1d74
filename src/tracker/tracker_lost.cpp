#include <Eigen/Cholesky>
#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "active_matching_slam/image/image_quality.h"
#include "active_matching_slam/map/map_file.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Prior of a relocalised camera: position in mean depths of the inliers, rotation [rad].
/// Derivation: vague, ten times and more what inliers of some pixels leave open (about 1 % of the
/// depth, 0.01 rad), so that the update by the inliers determines the pose.
constexpr double kRelocalisedSigmaPosition = 0.2, kRelocalisedSigmaRotation = 0.1;
constexpr std::size_t kMostLostMaps = 4;  ///< Cost: memory, and time until each is looked in again

}  // namespace

/// Starts anew when the map has turned out wrong. One that was right before is kept: there, few
/// matches mean that the scene, or the view of it, has changed.
bool Tracker::Implementation::giveUpWrongMap(const FrameState& current, TrackedFrame* frame) {
  if (current.matching.statistics.cut_short) return false;  // not all was looked for
  std::vector<FeatureId> matched;
  for (const FeatureMeasurement& measurement : current.measurements)
    matched.push_back(measurement.id);
  map_monitor_.add(last_stamp_s_, current.prior.ids, matched,
                   measureImageQuality(current.image).sharpness);
  if (!map_monitor_.isWrong() || map_monitor_.hasBeenRight() || !options_.mapping) return false;
  const std::string reason =
      "the map is wrong: half of what it predicts does not match in images as sharp as ever; "
      "started anew";
  abandonMap(reason);
  start(current.image, frame);
  frame->reason = reason;
  return true;
}

/// Decides whether the camera is still tracked.
void Tracker::Implementation::updateTrackingState(const FrameState& current) {
  const int matched = static_cast<int>(current.measurements.size());
  if (matched >= options_.minimum_matches) {
    poor_frames_ = 0;
    state_ = TrackingState::kTracking;
    reason_.clear();
    return;
  }
  ++poor_frames_;
  std::ostringstream reason;
  if (current.matching.statistics.cut_short)
    reason << "out of time after " << current.matching.statistics.searches << " searches: ";
  reason << matched << " of " << current.prior.size() << " features matched, "
         << options_.minimum_matches << " are needed";
  reason_ = reason.str();
  if (poor_frames_ >= options_.lost_after_frames && state_ != TrackingState::kLost &&
      !isPoseKnown())
    lose(reason_);
}

/// By odometry alone, where nothing matches: as well as a camera that was found anew, before its
/// matches are fused.
bool Tracker::Implementation::isPoseKnown() const {
  if (!isTranslationKnown() || filter_.features().empty()) return false;
  double distance = 0.0;
  for (const FeatureState& feature : filter_.features())
    distance += (homogeneousPosition(feature).head<3>() -
                 homogeneousPosition(feature).w() * filter_.camera().position_world)
                    .norm() /
                std::max(homogeneousPosition(feature).w(), options_.filter.minimum_inverse_depth);
  distance /= static_cast<double>(filter_.features().size());
  const Eigen::Matrix<double, 12, 1> variance = filter_.cameraCovariance().diagonal();
  const auto square = [](double x) { return x * x; };
  return variance.head<3>().maxCoeff() < square(kRelocalisedSigmaPosition * distance) &&
         variance.segment<3>(CameraError::kRotation).maxCoeff() < square(kRelocalisedSigmaRotation);
}

/// From here on no pose is claimed. The camera is taken to have stopped somewhere near.
void Tracker::Implementation::lose(const std::string& reason) {
  lookForCamera(reason);
  ++times_lost_;
  map_monitor_.interrupt();
  CameraState camera = filter_.camera();
  camera.velocity_world.setZero();
  camera.angular_velocity_camera.setZero();
  filter_.relocateCamera(camera, filter_.cameraCovariance());
}

void Tracker::Implementation::lookForCamera(const std::string& reason) {
  state_ = TrackingState::kLost;
  reason_ = reason;
  lost_stamp_s_ = last_stamp_s_;
  poor_frames_ = 0;
  initialiser_.end();
}

/// What becomes of an image while the camera is lost.
void Tracker::Implementation::relocaliseWhileLost(const cv::Mat& image, double interval_s,
                                                  TrackedFrame* frame) {
  const double lost_s = last_stamp_s_ - lost_stamp_s_;
  // Lost soon after the start: nothing is known but directions.
  if (options_.mapping && !relocaliser_.canFind(filter_, map_) &&
      submaps_.tree().leaves().empty()) {
    abandonMap("lost with a map that has too few features of known depth: started anew");
    return;
  }
  if (options_.mapping && options_.reset_when_lost_after_s > 0.0 &&
      lost_s >= options_.reset_when_lost_after_s) {
    std::ostringstream reason;
    reason << "lost for " << lost_s << " s: started anew";
    abandonMap(reason.str());
    return;
  }
  const bool is_new_map_due = options_.mapping && options_.new_map_when_lost_after_s > 0.0 &&
                              lost_s >= options_.new_map_when_lost_after_s && !awaits_loaded_map_ &&
                              !is_pose_given_;
  const bool is_time_shared = is_new_map_due || is_pose_given_;
  if (lookWhileLost(image, is_time_shared ? LookBudget::kHalf : LookBudget::kWhole, interval_s,
                    frame))
    return;
  if (is_new_map_due) beginNewMap(image, frame);
}

Tracker::Implementation::LostMap Tracker::Implementation::storeMap() {
  return {map_number_, lost_stamp_s_, filter_, noise_, map_, map_monitor_, scale_source_, submaps_};
}

void Tracker::Implementation::takeMap(LostMap stored) {
  map_number_ = stored.number;
  filter_ = std::move(stored.filter);
  filter_.setOptions(withTrustIn(camera_.calibration(), options_.filter));
  noise_ = std::move(stored.noise);
  noise_.setOptions(options_.filter);
  map_ = std::move(stored.map);
  map_monitor_ = stored.monitor;
  scale_source_ = stored.scale_source;
  submaps_ = std::move(stored.submaps);
  submaps_.setOptions(options_.submap_filter);
  loop_witness_.clear();
  loop_undo_.reset();
  scale_finder_.reset();
  motion_noise_.reset();
  structure_.clear();
  structure_snapshot_ = {};
  initialiser_.end();
  endLook();
}

/// Keeps the map that was lost, and begins another one where the image has enough to begin from.
bool Tracker::Implementation::beginNewMap(const cv::Mat& image, TrackedFrame* frame) {
  LostMap stored = storeMap();
  const std::string reason = reason_;
  clearMap();
  start(image, frame);
  if (state_ != TrackingState::kTracking) {
    takeMap(std::move(stored));
    state_ = TrackingState::kLost;
    reason_ = reason;
    frame->features_started = 0;
    return false;
  }
  std::ostringstream begun;
  begun << "lost for " << last_stamp_s_ - lost_stamp_s_ << " s: map " << maps_begun_
        << " begun, the camera is looked for in the one before on the side";
  frame->reason = begun.str();
  map_number_ = maps_begun_++;
  ++jumps_;
  lost_maps_.push_back(std::move(stored));
  if (lost_maps_.size() > kMostLostMaps) lost_maps_.erase(lost_maps_.begin());
  last_look_stamp_s_ = last_stamp_s_;
  return true;
}

/// Gives up maps that were lost too long ago.
void Tracker::Implementation::forgetOldMaps() {
  if (!(options_.reset_when_lost_after_s > 0.0)) return;
  lost_maps_.erase(std::remove_if(lost_maps_.begin(), lost_maps_.end(),
                                  [this](const LostMap& lost) {
                                    return last_stamp_s_ - lost.lost_stamp_s >=
                                           options_.reset_when_lost_after_s;
                                  }),
                   lost_maps_.end());
}

/// Searches the gates of a camera that is somewhere near where it was said to be. The matches must
/// lead to a pose that stands the proof of any place; else the state is as before.
bool Tracker::Implementation::findNearGivenPose(const cv::Mat& image, double interval_s,
                                                TrackedFrame* frame) {
  FrameState current = measure(image, interval_s);
  current.reference_image.release();  // where that was taken is no better known
  cascade_.match(options_.matching, options_.fallback_matchers, &current);
  const auto found =
      relocaliser_.findByMatches(camera_, image, filter_, map_, selectMeasurements(current), mask_);
  if (found) placeCamera(*found, frame);
  return found.has_value();
}

/// Puts a filter's camera where it was found in its map.
UpdateReport Tracker::Implementation::relocateByInliers(const Relocalisation& found,
                                                        Ekf* filter) const {
  CameraState camera;
  camera.setPoseWorldCamera(found.T_world_camera);
  double depth = 0.0;
  int known = 0;  // the others have been retired since
  for (const FeatureMeasurement& inlier : found.inliers) {
    const FeatureState* feature = filter->find(inlier.id);
    if (!feature) continue;
    depth += (feature->position() - camera.position_world).norm();
    ++known;
  }
  if (known == 0) return {};
  depth /= known;
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << Eigen::Vector3d::Constant(kRelocalisedSigmaPosition * depth),
      Eigen::Vector3d::Constant(kRelocalisedSigmaRotation),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_velocity_mps),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_angular_velocity_rps);
  filter->relocateCamera(camera, sigma.array().square().matrix().asDiagonal());
  return filter->update(camera_, found.inliers, {}, corrected());
}

/// Puts the camera where it was found in the map.
void Tracker::Implementation::placeCamera(const Relocalisation& found, TrackedFrame* frame) {
  const UpdateReport report = relocateByInliers(found, &filter_);
  frame->nis = report.nis;
  frame->nis_degrees = 2 * report.used;
  state_ = TrackingState::kTracking;
  reason_.clear();
  poor_frames_ = 0;
  is_pose_given_ = false;
  awaits_loaded_map_ = false;
  endLook();
  motion_noise_.reset();
  initialiser_.end();
  ++jumps_;
}

void Tracker::Implementation::setPose(const Eigen::Isometry3d& T_world_camera,
                                      const Eigen::Matrix<double, 6, 6>& covariance) {
  if (map_.size() == 0) throw std::runtime_error("there is no map that the pose could be in");
  if (!T_world_camera.matrix().allFinite()) throw std::invalid_argument("the pose is not finite");
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (!covariance.allFinite() || factor.info() != Eigen::Success)
    throw std::invalid_argument("the pose's covariance is not positive definite");
  lookForCamera("a pose was given: looking for the camera near it");
  map_monitor_.interrupt();
  endLook();
  is_pose_given_ = true;
  CameraState camera;
  camera.setPoseWorldCamera(T_world_camera);
  MotionCovariance P = MotionCovariance::Zero();
  P.topLeftCorner<6, 6>() = covariance;
  const auto square = [](double x) { return x * x; };
  P.diagonal()
      .segment<3>(CameraError::kVelocity)
      .setConstant(square(options_.filter.initial_sigma_velocity_mps));
  P.diagonal()
      .segment<3>(CameraError::kAngularVelocity)
      .setConstant(square(options_.filter.initial_sigma_angular_velocity_rps));
  filter_.relocateCamera(camera, P);
}

void Tracker::Implementation::saveMap(const std::string& path) const {
  if (map_.size() == 0) throw std::runtime_error("there is no map to save yet");
  if (!options_.mapping)
    throw std::runtime_error("mapping is false: the map is still as it was loaded");
  MapFileContent content;
  content.camera = camera_.calibration();
  content.camera_state = filter_.camera();
  content.features = filter_.features();
  content.covariance = filter_.savedCovariance();
  content.map = map_.features();
  content.next_id = filter_.nextId();
  content.scale_source = static_cast<int>(scale_source_);
  content.graph = structure_.graph();
  submaps_.save(filter_, &content);
  content.template_size_px = options_.image.template_size_px;
  content.source_patch_size_px = options_.image.source_patch_size_px;
  writeMapFile(path, content);
}

void Tracker::Implementation::loadMap(const std::string& path) {
  const MapFileContent content = readMapFile(path);
  const auto refuse = [&](const std::string& why) {
    throw std::runtime_error("'" + path + "': " + why);
  };
  if (!sameImaging(content.camera, camera_.calibration()))
    refuse("the map was made with another camera, calibration or image/working_width");
  if (content.template_size_px != options_.image.template_size_px ||
      content.source_patch_size_px != options_.image.source_patch_size_px)
    refuse("the map was made with another image/template_size_px or image/source_patch_size_px");
  if (scaleSourceName(static_cast<ScaleSource>(content.scale_source)).empty())
    refuse("the source of scale is unknown");
  filter_.restore(content.camera_state, content.features, content.covariance, content.next_id);
  map_.clear();
  submaps_.clear();
  loop_witness_.clear();
  loop_undo_.reset();
  for (const MapFeature& feature : content.map) map_.add(feature);
  scale_source_ = static_cast<ScaleSource>(content.scale_source);
  scale_finder_.reset();
  structure_.restore(content.graph);
  structure_snapshot_ = {};
  lost_maps_.clear();
  endLook();
  awaits_loaded_map_ = true;
  map_number_ = maps_begun_++;
  is_pose_given_ = false;
  const bool has_submaps = !content.frozen.empty();
  if (has_submaps && submaps_.isEnabled()) submaps_.restore(content);
  lookForCamera(has_submaps && !submaps_.isEnabled()
                    ? "map loaded, without its submaps, as submaps/enabled is false: looking for "
                      "the camera in it"
                    : "map loaded: looking for the camera in it");
}

}  // namespace active_matching_slam
