#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Every how many frames submaps that should be in view are made active. Cost: it takes as long as
/// a frame or two, and what is asked of each as long as a tenth of one.
constexpr int kReactivationPeriodFrames = 4;
/// With room left for fewer features, some are laid aside. Cost: with less room, features are begun
/// later in a view that changes fast; with more, some leave that are soon to be seen again.
constexpr int kRoomLeft = 15;
/// Submaps in which the camera is looked for in an image. Cost: each takes as long as a quarter of
/// the corners, which all have in common.
constexpr int kSubmapsPerLook = 3;
/// Features matched in so many images before a loop are carried along with the camera to where its
/// submap shows it: a start for the correction, no more. Cost: iterations.
constexpr std::int64_t kCarriedImages = 40;
/// Images after a loop in which their innovations may tell that it was wrong. Cost: later ones tell
/// of other things, too.
constexpr int kWatchedImages = 50;
/// Of these, before it is judged. Cost: a wrong loop lasts so long.
constexpr int kLeastWatchedImages = 10;
/// A loop is taken back when submaps are missed where it predicts them so often that one in so many
/// right loops would be. Cost: so rarely is a right one taken back; one that is wrong lasts a
/// submap longer.
constexpr double kMissedOdds = 100.0;
/// Of what chance makes of an innovation. Cost: so rarely is a right loop refused.
constexpr double kInnovationProbability = 0.9999;

}  // namespace

/// What has left the view of a full map is laid aside, and what comes into view again is active.
void Tracker::Implementation::keepSubmaps(const TrackedFrame& frame) {
  if (!submaps_.isEnabled()) return;
  std::vector<FeatureId> behind_mask;
  const std::vector<VisibleFeature> visible = visibleFeatures(&behind_mask);
  submaps_.observe(visible, behind_mask, map_, last_stamp_s_);
  // Until the first images have been adjusted together, what they made of the map may be replaced.
  if (!initialiser_.isDone() || poor_frames_ > 0 || state_ != TrackingState::kTracking) return;
  if (submaps_.isTrialOver()) submaps_.putBack(last_stamp_s_, &filter_, &map_);
  if (map_.size() + kRoomLeft > options_.map.maximum_features)
    submaps_.layAside(last_stamp_s_, &filter_, &map_);
  submaps_.restSeparators(last_stamp_s_, &filter_, &map_);
  if (frame.index % kReactivationPeriodFrames != 0 || submaps_.tree().empty() ||
      submaps_.hasTrial())
    return;
  const std::vector<FrozenView> views = submaps_.visible(
      submaps_.positions(filter_), filter_, camera_, options_.map, options_.image.border_px);
  const int submap = submaps_.submapInView(views, filter_);
  if (submap >= 0) {
    submaps_.activateOnTrial(submap, last_stamp_s_, options_.map.maximum_features, &filter_, &map_);
    return;
  }
  if (!submaps_.isPlaceKnown(filter_, last_stamp_s_)) return;
  submaps_.searchWaiting();
  const std::vector<FeatureId> separators = submaps_.separatorsInView(views, filter_);
  if (!separators.empty() && map_.size() + static_cast<int>(separators.size()) <=
                                 options_.map.maximum_features + SubmapKeeper::kSlack)
    submaps_.activateSeparators(separators, last_stamp_s_, &filter_, &map_);
}

/// Where features that were laid aside should be seen: nothing is to be started beside them.
std::vector<Eigen::Vector2d> Tracker::Implementation::frozenPixels() const {
  std::vector<Eigen::Vector2d> pixels;
  if (submaps_.tree().empty()) return pixels;
  for (const FrozenView& view : submaps_.visible(submaps_.positions(filter_), filter_, camera_,
                                                 options_.map, options_.image.border_px))
    pixels.push_back(view.pixel);
  return pixels;
}

/// Looks for places that were seen before, where the map may have drifted so far that they are not
/// where they are predicted: a part of the look in each frame. A place is proven in the image of
/// now, to which the camera has been tracked since the one that was searched.
void Tracker::Implementation::lookForLoop(const cv::Mat& image, double interval_s,
                                          TrackedFrame* frame) {
  if (!submaps_.isEnabled() || submaps_.tree().leaves().empty() || !initialiser_.isDone() ||
      poor_frames_ > 0 || state_ != TrackingState::kTracking)
    return;
  if (!look_ && frame->index % kReactivationPeriodFrames == kReactivationPeriodFrames / 2) {
    std::vector<Place> places;
    for (const int submap : submaps_.loopCandidates(submaps_.positions(filter_), filter_, camera_,
                                                    options_.map, kSubmapsPerLook))
      places.insert(places.begin(), {Place::Kind::kSubmap, submap});
    beginLook(OngoingLook::Purpose::kLoop, image, std::move(places));
  }
  const double milliseconds = lookMilliseconds(LookBudget::kQuarter, interval_s);
  double spent_ms = 0.0;
  while (look_ && look_->purpose == OngoingLook::Purpose::kLoop) {
    const auto pose = continueLook(milliseconds, &spent_ms);
    if (!pose) return;
    const int submap = look_->places.back().number;
    const Eigen::Isometry3d T_then_now =
        look_->T_world_camera.inverse() * filter_.camera().poseWorldCamera();
    const std::vector<Landmark> landmarks = landmarksOf(look_->places.back());
    endPlace();
    spent_ms += Relocaliser::proofMs(landmarks);
    const auto found = relocaliser_.prove(camera_, image, landmarks, *pose * T_then_now, mask_);
    if (!found) continue;
    const Conditional points =
        submaps_.tree().givenActive(activePoints(filter_), *submaps_.tree().find(submap));
    const CameraOffset offset = offsetFromSubmap(filter_, camera_, points, *found);
    const bool is_confirmed =
        loop_witness_.confirms(frame->index, filter_.camera().poseWorldCamera(), *found, offset);
    if (!offset.isExpected() && !is_confirmed) {
      submaps_.lookAgain(submap);
      continue;
    }
    closeLoop(submap, *found, offset, frame);
    return;
  }
}

/// Makes the submap part of the active map and corrects all by where it shows the camera.
void Tracker::Implementation::closeLoop(int submap, const Relocalisation& found,
                                        const CameraOffset& offset, TrackedFrame* frame) {
  submaps_.putBack(last_stamp_s_, &filter_, &map_);
  LoopUndo undo{filter_, map_, submaps_, 0, 0.0, 0};
  const Eigen::Isometry3d before = filter_.camera().poseWorldCamera();
  std::vector<FeatureId> carried;
  for (const MapFeature& feature : map_.features())
    if (frame->index - feature.last_matched_frame <= kCarriedImages) carried.push_back(feature.id);
  const auto old_frozen = submaps_.positions(filter_);
  const int no_limit = map_.size() + submaps_.tree().frozenCount();
  submaps_.activate(submap, last_stamp_s_, no_limit, &filter_, &map_);
  submaps_.openTrunk(&filter_);
  std::map<FeatureId, Eigen::Vector3d> old_active;
  for (const FeatureState& feature : filter_.features())
    old_active[feature.id] = feature.position();
  constexpr double kFreedoms = 6.0;
  if (!offset.isExpected())
    loosenCamera((offset.squared / kFreedoms - 1.0) * offset.predicted, carried, &filter_);
  std::vector<FeatureMeasurement> measurements = found.inliers;
  for (FeatureMeasurement& measurement : measurements)
    measurement.sigma_px = std::max(options_.filter.sigma_px, found.rms_px / std::sqrt(2.0));
  const Eigen::VectorXd start =
      errorOfMotion(found.T_world_camera * before.inverse(), filter_.camera(), filter_.features(),
                    carried, filter_.stateSize());
  const UpdateReport report = filter_.update(camera_, measurements, {}, Corrected::kAll, start);
  if (!report.healthy || report.used == 0 ||
      report.nis > chiSquareQuantile(2 * report.used, kInnovationProbability)) {
    takeBack(std::move(undo));
    return;
  }
  submaps_.closeTrunk(&filter_);
  submaps_.trust();
  const Eigen::Isometry3d jump = filter_.camera().poseWorldCamera() * before.inverse();
  for (const FeatureState& feature : filter_.features()) {
    SourcePatch patch = map_.find(feature.id)->patch;
    if (std::binary_search(carried.begin(), carried.end(), feature.id))
      patch.T_world_camera = jump * patch.T_world_camera;
    else
      patch.T_world_camera.translation() += feature.position() - old_active.at(feature.id);
    map_.retakePatch(feature.id, patch);
  }
  submaps_.movePatches(old_frozen, filter_);
  T_world_reference_ = jump * T_world_reference_;
  loop_undo_ = std::move(undo);
  loop_witness_.clear();
  endLook();
  ++loops_;
  ++map_epoch_;
  frame->map_jump = jump;
  frame->reason = "a loop was closed: the camera was found in a submap that it had left";
}

/// As it was before a loop was closed.
void Tracker::Implementation::takeBack(LoopUndo undo) {
  filter_ = std::move(undo.filter);
  map_ = std::move(undo.map);
  submaps_ = std::move(undo.submaps);
  loop_undo_.reset();
  loop_witness_.clear();
  endLook();
}

/// A loop that was wrong shows in the images after it: they contradict the map, or other submaps
/// are not where it predicts them; until one is, the map of before is kept. A wrong loop is then
/// taken back, and the camera looked for, for where it has gone meanwhile is not known in the old
/// map. Whether it was.
bool Tracker::Implementation::watchLoop(TrackedFrame* frame) {
  if (!loop_undo_) return false;
  const SubmapKeeper& before = loop_undo_->submaps;
  const bool is_confirmed = submaps_.foundWherePredicted() > before.foundWherePredicted();
  // In a wrong map all are missed; in a right one as many as before (Laplace's rule), by a
  // sequential test of the one against the other (Wald 1945).
  const double missed_share = (before.missedWherePredicted() + 1.0) /
                              (before.missedWherePredicted() + before.foundWherePredicted() + 2.0);
  const int missed = submaps_.missedWherePredicted() - before.missedWherePredicted();
  const bool is_missed = !is_confirmed && -missed * std::log(missed_share) > std::log(kMissedOdds);
  bool is_contradicted = false;
  if (loop_undo_->images < kWatchedImages) {
    ++loop_undo_->images;
    loop_undo_->nis += frame->nis;
    loop_undo_->degrees += frame->nis_degrees;
    const int degrees = loop_undo_->degrees / loop_undo_->images;
    // Errors of features last: images are counted as one of them.
    is_contradicted =
        state_ == TrackingState::kLost ||
        (loop_undo_->images >= kLeastWatchedImages && degrees > 0 &&
         loop_undo_->nis / loop_undo_->images > chiSquareQuantile(degrees, kInnovationProbability));
  } else if (is_confirmed) {
    loop_undo_.reset();
    return false;
  }
  if (!is_contradicted && !is_missed) return false;
  takeBack(std::move(*loop_undo_));
  --loops_;
  ++map_epoch_;
  ++jumps_;
  lose("a loop was closed that the images after it contradict: taken back, looking for the camera");
  frame->reason = reason_;
  return true;
}

}  // namespace active_matching_slam
