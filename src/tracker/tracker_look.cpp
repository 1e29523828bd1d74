// A look for the camera in a whole image takes as long as some frames: it is cut into steps, of
// which each frame takes as many as there is time for. Where it is found in an image that has
// become an old one, the camera is searched near there in that of now.

#include <algorithm>
#include <limits>
#include <sstream>
#include <utility>

#include "active_matching_slam/math/pixel_scale.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Time between two looks in maps in which the camera was lost, while it is tracked in another [s].
/// Cost: they take a part of every frame's time meanwhile.
constexpr double kLookPeriodS = 0.5;
/// Submaps in which a lost camera is looked for in an image. Cost: each takes as long as a quarter
/// of the corners, which all have in common.
constexpr int kSubmapsPerLookWhileLost = 3;
/// Images in which the camera is searched near where it was in an old one. Cost: in each the old
/// pose says less, and a new look is put off.
constexpr int kMostConfirmingImages = 2;
/// Standard deviation of the logarithm of two maps' ratio of units with which they are joined.
/// Derivation: the error of the first order that points are taken over by is half its square, 2 %.
constexpr double kMostUnitSigma = 0.2;

}  // namespace

/// Of a frame's time for matching, modelled: so it is the same on every machine.
double Tracker::Implementation::lookMilliseconds(LookBudget share, double interval_s) const {
  if (!(options_.matching.max_milliseconds > 0.0)) return std::numeric_limits<double>::infinity();
  const double whole = options_.matching.max_milliseconds *
                       std::max(1.0, options_.cascade.budget_rate_hz *
                                         std::min(interval_s, options_.max_frame_interval_s));
  switch (share) {
    case LookBudget::kQuarter:
      return 0.25 * whole;
    case LookBudget::kHalf:
      return 0.5 * whole;
    default:
      return whole;
  }
}

void Tracker::Implementation::endLook() {
  look_.reset();
  sighting_.reset();
}

/// Goes on to the next place, or ends.
void Tracker::Implementation::endPlace() {
  look_->places.pop_back();
  look_->look.beginPlace();
  if (look_->places.empty()) look_.reset();
}

/// Nothing where there is no place to look at.
void Tracker::Implementation::beginLook(OngoingLook::Purpose purpose, const cv::Mat& image,
                                        std::vector<Place> places) {
  if (places.empty()) return;
  look_ = OngoingLook{purpose, CameraLook(image.clone(), mask_), std::move(places), last_stamp_s_,
                      filter_.camera().poseWorldCamera()};
}

int Tracker::Implementation::lostMapIndex(int number) const {
  for (std::size_t k = 0; k < lost_maps_.size(); ++k)
    if (lost_maps_[k].number == number) return static_cast<int>(k);
  return -1;
}

/// None where the place is no more.
std::vector<Landmark> Tracker::Implementation::landmarksOf(const Place& place) const {
  if (place.kind == Place::Kind::kMap) return relocaliser_.usableLandmarks(filter_, map_);
  if (place.kind == Place::Kind::kSubmap)
    return submaps_.landmarks(place.number, submaps_.positions(filter_));
  const int k = lostMapIndex(place.number);
  if (k < 0) return {};
  return relocaliser_.usableLandmarks(lost_maps_[k].filter, lost_maps_[k].map);
}

/// Goes on with the look in hand, at least by a step. A pose in the last of its places, of when the
/// look began and not proven, as soon as there is one; the look is then to be continued with the
/// next place.
std::optional<Eigen::Isometry3d> Tracker::Implementation::continueLook(double milliseconds,
                                                                       double* spent_ms) {
  while (look_) {
    const std::vector<Landmark> landmarks = landmarksOf(look_->places.back());
    while (!look_->look.isOver()) {
      const double step_ms = Relocaliser::stepMs(landmarks, look_->look);
      if (*spent_ms > 0.0 && *spent_ms + step_ms > milliseconds) return std::nullopt;
      relocaliser_.step(camera_, landmarks, &look_->look);
      *spent_ms += step_ms;
    }
    if (look_->look.pose()) return look_->look.pose();
    endPlace();
  }
  return std::nullopt;
}

/// Goes on with the look in hand. Where a pose is proven in the image that is searched, the look is
/// at its end.
std::optional<Tracker::Implementation::Sighting> Tracker::Implementation::proveLook(
    double milliseconds) {
  double spent_ms = 0.0;
  while (look_) {
    const auto pose = continueLook(milliseconds, &spent_ms);
    if (!pose) return std::nullopt;
    const Place place = look_->places.back();
    const std::vector<Landmark> landmarks = landmarksOf(place);
    spent_ms += Relocaliser::proofMs(landmarks);
    const cv::Mat searched = look_->look.image();
    auto found = relocaliser_.prove(camera_, searched, landmarks, *pose, look_->look.mask());
    const double stamp_s = look_->stamp_s;
    const Eigen::Isometry3d T_world_camera = look_->T_world_camera;
    endPlace();
    if (!found) continue;
    look_.reset();
    return Sighting{place, *std::move(found), searched, stamp_s, T_world_camera};
  }
  return std::nullopt;
}

/// The map in hand, some of its submaps in turn, and the other maps.
std::vector<Tracker::Implementation::Place> Tracker::Implementation::placesWhileLost() {
  std::vector<Place> places;
  for (const LostMap& lost : lost_maps_) places.push_back({Place::Kind::kLostMap, lost.number});
  if (options_.mapping && submaps_.isEnabled())
    for (const int submap : submaps_.inTurn(kSubmapsPerLookWhileLost))
      places.push_back({Place::Kind::kSubmap, submap});
  if (relocaliser_.canFind(filter_, map_)) places.push_back({Place::Kind::kMap, map_number_});
  return places;
}

/// Where the camera is lost, or may be. Whether it was found in this image.
bool Tracker::Implementation::lookWhileLost(const cv::Mat& image, LookBudget share,
                                            double interval_s, TrackedFrame* frame) {
  if (look_ && look_->purpose != OngoingLook::Purpose::kLost) endLook();
  if (sighting_) {
    Sighting sighting = *std::exchange(sighting_, std::nullopt);
    if (const auto found = findNear(sighting, image, interval_s)) {
      goOnIn(sighting.place, *found, frame);
      return true;
    }
    if (++sighting.images < kMostConfirmingImages) sighting_ = std::move(sighting);
    return false;
  }
  if (!look_) beginLook(OngoingLook::Purpose::kLost, image, placesWhileLost());
  sighting_ = proveLook(lookMilliseconds(share, interval_s));
  if (!sighting_ || sighting_->stamp_s != last_stamp_s_) return false;
  const Sighting now = *std::exchange(sighting_, std::nullopt);
  goOnIn(now.place, now.found, frame);
  return true;
}

/// Where the camera is now that was found in an old image: as far from there as one of unknown
/// velocity may have come since, and as the image has moved. Proven like any place. What is in hand
/// stays as it is.
std::optional<Relocalisation> Tracker::Implementation::findNear(const Sighting& sighting,
                                                                const cv::Mat& image,
                                                                double interval_s) {
  if (landmarksOf(sighting.place).empty()) return std::nullopt;
  LostMap in_hand = storeMap();
  const auto motion = motion_;
  const cv::Mat reference_image = reference_image_;
  const Eigen::Isometry3d T_world_reference = T_world_reference_;
  const double predicted_interval_s = predicted_interval_s_;
  const std::int64_t reference_index = reference_index_;
  const int poor_frames = poor_frames_;
  enterPlace(sighting.place);
  motion_.reset();
  relocateByInliers(sighting.found, &filter_);
  reference_image_ = sighting.image;
  reference_index_ = -1;
  T_world_reference_ = filter_.camera().poseWorldCamera();
  poor_frames_ = 0;
  predicted_interval_s_ = std::min(last_stamp_s_ - sighting.stamp_s, options_.max_frame_interval_s);
  filter_.predict(predicted_interval_s_, motion_noise_.widest());
  FrameState current = measure(image, interval_s);
  MatchOptions matching = options_.matching;  // the time of this frame, not of all since then
  matching.max_milliseconds = lookMilliseconds(LookBudget::kWhole, interval_s);
  if (options_.matching.max_milliseconds > 0.0)
    matching.max_milliseconds /=
        std::max(1.0, options_.cascade.budget_rate_hz * predicted_interval_s_);
  else
    matching.max_milliseconds = 0.0;
  cascade_.match(matching, options_.fallback_matchers, &current);
  const auto found =
      relocaliser_.findByMatches(camera_, image, filter_, map_, selectMeasurements(current), mask_);
  filter_ = std::move(in_hand.filter);
  noise_ = std::move(in_hand.noise);
  map_ = std::move(in_hand.map);
  submaps_ = std::move(in_hand.submaps);
  motion_ = motion;
  reference_image_ = reference_image;
  T_world_reference_ = T_world_reference;
  predicted_interval_s_ = predicted_interval_s;
  reference_index_ = reference_index;
  poor_frames_ = poor_frames;
  return found;
}

/// Makes what is known of a place the filter's and the map's.
void Tracker::Implementation::enterPlace(const Place& place) {
  if (place.kind == Place::Kind::kSubmap) {
    const int no_limit = map_.size() + submaps_.tree().frozenCount();
    submaps_.activate(place.number, last_stamp_s_, no_limit, &filter_, &map_);
  } else if (place.kind == Place::Kind::kLostMap) {
    const LostMap& lost = lost_maps_[static_cast<std::size_t>(lostMapIndex(place.number))];
    filter_ = lost.filter;
    noise_ = lost.noise;
    map_ = lost.map;
    submaps_ = lost.submaps;
  }
}

/// Goes on where the camera was found. A map that is left is kept in the place of the one entered.
void Tracker::Implementation::goOnIn(const Place& place, const Relocalisation& found,
                                     TrackedFrame* frame) {
  if (place.kind == Place::Kind::kLostMap) {
    const auto k = static_cast<std::size_t>(lostMapIndex(place.number));
    LostMap left = storeMap();
    left.lost_stamp_s = last_stamp_s_;
    std::swap(left, lost_maps_[k]);
    takeMap(std::move(left));
    if (!relocaliser_.canFind(lost_maps_[k].filter, lost_maps_[k].map))
      lost_maps_.erase(lost_maps_.begin() + static_cast<std::ptrdiff_t>(k));
    frame->reason = "found again in map " + std::to_string(map_number_);
  } else if (place.kind == Place::Kind::kSubmap) {
    enterPlace(place);
    frame->reason = "found again in a submap that had been laid aside";
  }
  placeCamera(found, frame);
}

/// While the camera is tracked in one map, looks for it in those in which it was lost, a part of
/// the look in each frame. Found in an image of before, it is looked for at where it has moved
/// since: two looks that agree. Whether it goes on in another map.
bool Tracker::Implementation::lookForOtherMaps(const cv::Mat& image, double interval_s,
                                               TrackedFrame* frame) {
  if (state_ != TrackingState::kTracking || poor_frames_ > 0) return false;
  // It came back by itself.
  if (look_ && look_->purpose == OngoingLook::Purpose::kLost) endLook();
  if (sighting_ && sighting_->place.kind != Place::Kind::kLostMap) sighting_.reset();
  if (lost_maps_.empty()) return false;
  if (sighting_) return confirmOtherMap(image, frame);
  if (!look_ && last_stamp_s_ - last_look_stamp_s_ >= kLookPeriodS) {
    last_look_stamp_s_ = last_stamp_s_;
    std::vector<Place> places;
    for (const LostMap& lost : lost_maps_) places.push_back({Place::Kind::kLostMap, lost.number});
    beginLook(OngoingLook::Purpose::kOtherMap, image, std::move(places));
  }
  if (look_ && look_->purpose == OngoingLook::Purpose::kOtherMap)
    sighting_ = proveLook(lookMilliseconds(LookBudget::kQuarter, interval_s));
  return false;
}

/// The second look, of one place.
bool Tracker::Implementation::confirmOtherMap(const cv::Mat& image, TrackedFrame* frame) {
  Sighting sighting = *std::exchange(sighting_, std::nullopt);
  const int k = lostMapIndex(sighting.place.number);
  if (k < 0) return false;
  const LostMap& lost = lost_maps_[static_cast<std::size_t>(k)];
  // What the first look has in view tells the unit.
  Ekf then = lost.filter, here = filter_;
  relocateByInliers(sighting.found, &then);
  CameraState camera = here.camera();
  const Eigen::Isometry3d T_then_now = sighting.T_world_camera.inverse() * camera.poseWorldCamera();
  camera.setPoseWorldCamera(sighting.T_world_camera);
  here.relocateCamera(camera, here.cameraCovariance());
  const auto unit = unitRatio(camera_, then, here, sighting.found.inliers);
  Eigen::Isometry3d T_expected = T_then_now;
  T_expected.translation() *= unit ? unit->factor : 1.0;
  const auto found = relocaliser_.prove(camera_, image, landmarksOf(sighting.place),
                                        sighting.found.T_world_camera * T_expected, mask_);
  if (!found) {
    if (++sighting.images < kMostConfirmingImages) sighting_ = std::move(sighting);
    return false;
  }
  if (unit && !agree(camera_, lost.filter, sighting.found, *found, T_then_now, *unit)) return false;
  return joinMaps(sighting.place, *found, frame);
}

/// Makes one of the map in hand and another, in which the camera was found in this image: what the
/// newer one holds goes into the older, whose world and unit stay. Where they can't be joined, the
/// camera goes on in the older one. Whether that is another map.
bool Tracker::Implementation::joinMaps(const Place& place, const Relocalisation& found,
                                       TrackedFrame* frame) {
  const auto k = static_cast<std::size_t>(lostMapIndex(place.number));
  Ekf other = lost_maps_[k].filter;
  relocateByInliers(found, &other);
  const bool is_older = place.number < map_number_;
  const Ekf& newer = is_older ? filter_ : other;
  const SubmapKeeper& newer_submaps = is_older ? submaps_ : lost_maps_[k].submaps;
  auto unit = unitRatio(camera_, other, filter_, found.inliers);
  if (unit && !is_older) unit->factor = 1.0 / unit->factor;
  if (!options_.mapping || !unit || unit->log_sigma > kMostUnitSigma ||
      initialiser_.areDepthsGuessed() || !newer_submaps.tree().empty()) {
    if (is_older) goOnIn(place, found, frame);
    return is_older;
  }
  const Ekf newer_filter = newer;
  const FeatureMap newer_map = is_older ? map_ : lost_maps_[k].map;
  const int newer_number = std::max(place.number, map_number_);
  const Eigen::Isometry3d before = filter_.camera().poseWorldCamera();
  if (is_older) {
    LostMap stored = std::move(lost_maps_[k]);
    takeMap(std::move(stored));
    placeCamera(found, frame);
    frame->map_jump = filter_.camera().poseWorldCamera() * before.inverse();
    ++map_epoch_;
  }
  lost_maps_.erase(lost_maps_.begin() + static_cast<std::ptrdiff_t>(k));
  takeFeatures(newer_filter, newer_map, *unit);
  std::ostringstream reason;
  reason << "map " << newer_number << " joined with map " << map_number_ << ": its lengths times "
         << unit->factor;
  frame->reason = reason.str();
  return is_older;
}

/// Features of another map, as many as there is room for: those in view first, and none beside one
/// that is in the map.
void Tracker::Implementation::takeFeatures(const Ekf& other, const FeatureMap& other_map,
                                           const UnitRatio& unit) {
  const double distance_px =
      0.5 * options_.map.minimum_distance_px * pixelScale(camera_.width(), camera_.height());
  const std::vector<Eigen::Vector2d> occupied = occupiedPixels();
  std::vector<std::pair<bool, FeatureId>> candidates;  // out of view; those are last
  const Eigen::Isometry3d T_camera_other = other.camera().poseWorldCamera().inverse();
  for (const MapFeature& feature : other_map.features()) {
    const FeatureState* state = other.find(feature.id);
    if (!state) continue;
    const Eigen::Vector4d point = homogeneousPosition(*state);
    const auto pixel = camera_.project(T_camera_other.linear() * point.head<3>() +
                                       point.w() * T_camera_other.translation());
    const bool is_in_view = pixel && camera_.isInImage(*pixel);
    const bool is_beside =
        is_in_view && std::any_of(occupied.begin(), occupied.end(),
                                  [&](const auto& p) { return (p - *pixel).norm() < distance_px; });
    if (!is_beside) candidates.emplace_back(!is_in_view, feature.id);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  const auto room = [this] {
    return static_cast<std::size_t>(std::max(0, mostFeatures() - map_.size()));
  };
  while (submaps_.isEnabled() && room() < candidates.size() &&
         submaps_.layAside(last_stamp_s_, &filter_, &map_))
    continue;
  if (candidates.size() > room()) candidates.resize(room());
  std::vector<FeatureId> ids;
  for (const auto& candidate : candidates) ids.push_back(candidate.second);
  std::sort(ids.begin(), ids.end());
  const JoinedFeatures joined = joinFeatures(other, ids, unit, &filter_);
  FeatureId new_id = filter_.nextId() - static_cast<FeatureId>(joined.ids.size());
  for (const FeatureId id : joined.ids) {
    MapFeature feature = *other_map.find(id);
    feature.id = new_id++;
    feature.known = false;  // of the other map's target
    feature.patch.T_world_camera = joined(feature.patch.T_world_camera);
    map_.add(std::move(feature));
  }
}

}  // namespace active_matching_slam
