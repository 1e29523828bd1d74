#include <sstream>
#include <stdexcept>

#include "active_matching_slam/image/image_quality.h"
#include "active_matching_slam/map/map_file.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Prior of a relocalised camera: position in mean depths of the inliers, rotation [rad].
/// Derivation: vague, ten times and more what inliers of some pixels leave open (about 1 % of the
/// depth, 0.01 rad), so that the update by the inliers determines the pose.
constexpr double kRelocalisedSigmaPosition = 0.2, kRelocalisedSigmaRotation = 0.1;

}  // namespace

/// Starts anew when the map has turned out wrong. One that was right before is kept, and the camera
/// looked for in it.
bool Tracker::Implementation::giveUpWrongMap(const FrameState& current, TrackedFrame* frame) {
  if (current.matching.statistics.cut_short) return false;  // not all was looked for
  map_monitor_.add(last_stamp_s_, current.prior.size(),
                   static_cast<int>(current.measurements.size()),
                   measureImageQuality(current.image).sharpness);
  if (!map_monitor_.isWrong()) return false;
  if (map_monitor_.hasBeenRight()) {
    lose("half of what the map predicts does not match in images as sharp as ever");
    return true;
  }
  const std::string reason =
      "the map is wrong: half of what it predicts does not match in images as sharp as ever; "
      "started anew";
  reset(reason);
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
  reason << matched << " of " << current.prior.size() << " features matched, "
         << options_.minimum_matches << " are needed";
  reason_ = reason.str();
  if (poor_frames_ >= options_.lost_after_frames && state_ != TrackingState::kLost) {
    lose(reason_);
  }
}

/// From here on no pose is claimed. The camera is taken to have stopped somewhere near.
void Tracker::Implementation::lose(const std::string& reason) {
  state_ = TrackingState::kLost;
  reason_ = reason;
  lost_stamp_s_ = last_stamp_s_;
  poor_frames_ = 0;
  ++times_lost_;
  map_monitor_.interrupt();
  initialiser_.end();
  CameraState camera = filter_.camera();
  camera.velocity_world.setZero();
  camera.angular_velocity_camera.setZero();
  filter_.relocateCamera(camera, filter_.cameraCovariance());
}

/// What becomes of an image while the camera is lost.
void Tracker::Implementation::relocaliseWhileLost(const cv::Mat& image, TrackedFrame* frame) {
  const double lost_s = last_stamp_s_ - lost_stamp_s_;
  // Lost soon after the start: nothing is known but directions.
  if (!relocaliser_.canFind(filter_, map_)) {
    reset("lost with a map that has too few features of known depth: started anew");
    return;
  }
  if (options_.reset_when_lost_after_s > 0.0 && lost_s >= options_.reset_when_lost_after_s) {
    std::ostringstream reason;
    reason << "lost for " << lost_s << " s: started anew";
    reset(reason.str());
    return;
  }
  if (frame->index % kRelocalisationPeriodFrames == 0) relocalise(image, frame);
}

/// Searches the whole image for the whole map. False when the camera is not found; the state is
/// then as before.
bool Tracker::Implementation::relocalise(const cv::Mat& image, TrackedFrame* frame) {
  const auto found = relocaliser_.find(camera_, image, filter_, map_);
  if (!found) return false;
  CameraState camera;
  camera.setPoseWorldCamera(found->T_world_camera);
  double depth = 0.0;
  for (const FeatureMeasurement& inlier : found->inliers)
    depth += (filter_.find(inlier.id)->position() - camera.position_world).norm();
  depth /= static_cast<double>(found->inliers.size());
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << Eigen::Vector3d::Constant(kRelocalisedSigmaPosition * depth),
      Eigen::Vector3d::Constant(kRelocalisedSigmaRotation),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_velocity_mps),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_angular_velocity_rps);
  filter_.relocateCamera(camera, sigma.array().square().matrix().asDiagonal());
  const UpdateReport report = filter_.update(camera_, found->inliers);
  frame->nis = report.nis;
  frame->nis_degrees = 2 * report.used;
  state_ = TrackingState::kTracking;
  reason_.clear();
  poor_frames_ = 0;
  initialiser_.end();
  return true;
}

void Tracker::Implementation::saveMap(const std::string& path) const {
  if (map_.size() == 0) throw std::runtime_error("there is no map to save yet");
  MapFileContent content;
  content.camera = camera_.calibration();
  content.camera_state = filter_.camera();
  content.features = filter_.features();
  content.covariance = filter_.covariance();
  content.map = map_.features();
  content.next_id = filter_.nextId();
  content.scale_source = static_cast<int>(scale_source_);
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
  if (content.scale_source < 0 || content.scale_source > static_cast<int>(ScaleSource::kService))
    refuse("the source of scale is unknown");
  filter_.restore(content.camera_state, content.features, content.covariance, content.next_id);
  map_.clear();
  for (const MapFeature& feature : content.map) map_.add(feature);
  scale_source_ = static_cast<ScaleSource>(content.scale_source);
  initialiser_.end();
  structure_.clear();
  structure_snapshot_ = {};
  state_ = TrackingState::kLost;
  reason_ = "map loaded: looking for the camera in it";
  lost_stamp_s_ = last_stamp_s_;
  poor_frames_ = 0;
}

}  // namespace active_matching_slam
