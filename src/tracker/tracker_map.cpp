#include <algorithm>
#include <cmath>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/math/pixel_scale.h"
#include "known_depth.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Features started in one image after the first. Cost: each adds a correlation with all the state.
constexpr int kMaximumStartsPerFrame = 12;
/// Tree and submaps of a map of more features are made anew only every so many frames. Cost: they
/// take the square of the number of features.
constexpr std::size_t kLargeMap = 60;
constexpr int kLargeMapSnapshotFrames = 5;
/// Features from which on a pose of their own fits them. Derivation: three points, P3P.
constexpr std::size_t kFeaturesOfPose = 3;

}  // namespace

void Tracker::Implementation::retire(const std::vector<FeatureId>& ids, TrackedFrame* frame) {
  if (ids.empty()) return;
  if (submaps_.isEnabled()) {
    const std::vector<FeatureId> gone = submaps_.remove(ids, &filter_, map_);
    map_.retire(gone);
    frame->features_retired += static_cast<int>(gone.size());
    return;
  }
  filter_.removeFeatures(ids);
  map_.retire(ids);
  frame->features_retired += static_cast<int>(ids.size());
}

/// Features that turn out to be fixed to the image leave the map. True when a map is begun without
/// them: where enough for a pose took part in its initialisation, which took all that it saw for
/// one scene, and where they are most of what is matched, so that poses were of the image rather
/// than the camera.
bool Tracker::Implementation::leaveOutImageFixed(const FrameState& current, TrackedFrame* frame) {
  std::vector<Eigen::Vector2d> pixels;
  for (const FeatureMeasurement& measurement : current.measurements)
    pixels.push_back(measurement.pixel);
  if (!image_fixed_.add(camera_, current.image, last_stamp_s_, pixels, options_.image,
                        mask_.patchCentres()) ||
      !options_.mapping)
    return false;
  std::vector<FeatureId> ids;
  for (const FeatureMeasurement& measurement : current.measurements) {
    const MapFeature* feature = map_.find(measurement.id);
    if (feature && !feature->known && image_fixed_.contains(measurement.pixel))
      ids.push_back(measurement.id);
  }
  const bool is_most = 2 * ids.size() > current.measurements.size();
  if (!is_most && (initialiser_.isDone() || ids.size() < kFeaturesOfPose)) {
    retire(ids, frame);
    return false;
  }
  const std::string reason =
      "features were fixed to the image, and not of the scene: started anew without them";
  abandonMap(reason);
  start(current.image, frame);
  frame->reason = reason;
  return true;
}

/// That the map may hold. What may be laid aside soon is not deleted now.
int Tracker::Implementation::mostFeatures() const {
  return options_.map.maximum_features + (submaps_.isEnabled() ? SubmapKeeper::kSlack : 0);
}

void Tracker::Implementation::maintainMap(const cv::Mat& image, TrackedFrame* frame) {
  if (!options_.mapping) return;
  frame->features_converted = static_cast<int>(filter_.convertToPoints().size());
  retire(map_.failing(options_.map), frame);
  retire(map_.drifting(), frame);
  frame->features_failed = frame->features_retired;
  keepSubmaps(*frame);
  // The maximum may have been lowered.
  retire(leastInformative(map_.size() - mostFeatures()), frame);
  if (poor_frames_ > 0) return;  // where the camera is unsure, nothing new is put on the map
  const std::vector<VisibleFeature> visible = visibleFeatures();
  const int wanted =
      options_.map.features_per_frame - static_cast<int>(map_.expectedMatches(visible));
  if (wanted <= 0) return;
  const int excess = map_.size() + std::min(wanted, kMaximumStartsPerFrame) - mostFeatures();
  if (excess > 0) retire(leastInformative(excess), frame);
  frame->features_started +=
      startFeatures(image, visible, std::min(wanted, kMaximumStartsPerFrame), frame);
}

/// Features to make room in a full map.
std::vector<FeatureId> Tracker::Implementation::leastInformative(int count) const {
  if (submaps_.isEnabled()) {
    if (count <= 0) return {};
    std::vector<FeatureId> ids = options_.map.retire_by_information
                                     ? map_.leastInformative(map_.size())
                                     : map_.leastUseful(filter_, map_.size());
    ids.erase(std::remove_if(ids.begin(), ids.end(),
                             [this](FeatureId id) { return submaps_.isPinned(id); }),
              ids.end());
    if (static_cast<int>(ids.size()) > count) ids.resize(static_cast<std::size_t>(count));
    return ids;
  }
  return options_.map.retire_by_information ? map_.leastInformative(count)
                                            : map_.leastUseful(filter_, count);
}

/// Takes the source patches anew of features that have grown or shrunk half way to where they can't
/// be searched any more: around where the old patch, aligned to a fraction of a pixel, was matched.
/// That match misses the landmark by its noise, and the new patch will go on to: so the landmark is
/// taken to be that much off across its ray. Known points stay what they are.
void Tracker::Implementation::retakePatches(const FrameState& current) {
  if (!options_.mapping || poor_frames_ > 0 || !initialiser_.isDone()) return;
  const double least_score = 0.5 * (1.0 + options_.image.match_threshold);
  for (std::size_t k = 0; k < current.measurements.size(); ++k) {
    const FeatureMeasurement& measurement = current.measurements[k];
    const MapFeature* feature = map_.find(measurement.id);
    const FeatureState* state = filter_.find(measurement.id);
    if (!feature || !state || feature->known) continue;
    const double scale = current.candidates[current.inliers[k]].view.scale;
    if (scale * scale <= options_.map.maximum_scale && scale * scale >= options_.map.minimum_scale)
      continue;
    const int i = current.inliers[k];
    const SearchMatch& match = current.search.matches(i)[current.matching.match_of_feature[i]];
    if (!(match.sigma_px > 0.0) || match.score < least_score) continue;
    const auto patch = retakeSourcePatch(
        feature->patch, camera_, filter_.camera().poseWorldCamera(), homogeneousPosition(*state),
        current.image, measurement.pixel, options_.image.source_patch_size_px);
    if (!patch) continue;
    map_.retakePatch(measurement.id, *patch);
    filter_.loosenLandmark(camera_, measurement.id,
                           measurement.sigma_px * std::sqrt(measurement.variance_inflation));
  }
}

/// Adds the frame to the graph of mutual information: all that is predicted visible. What was
/// chosen to be measured is spread over the image, and would leave out the links between
/// neighbours. It is a prediction of its own, so that whether the graph is made changes no bit
/// of the measurements.
void Tracker::Implementation::observeStructure(const std::vector<VisibleFeature>& visible) {
  std::vector<FeatureId> ids;
  for (const VisibleFeature& feature : visible) ids.push_back(feature.id);
  const PredictedMeasurements predicted =
      filter_.predictMeasurements(camera_, ids, 0.0, options_.structure_accelerations);
  structure_.addFrame(predicted.ids, predicted.S);
}

/// What has left the map stays in the graph, as far as there is room. The tree and the submaps of a
/// large map are made anew every few frames only.
void Tracker::Implementation::updateStructure(TrackedFrame* frame) {
  std::vector<FeatureId> ids;
  for (const MapFeature& feature : map_.features()) ids.push_back(feature.id);
  structure_.forgetWeakest(ids, options_.submaps.kept_features);
  const bool is_large =
      structure_snapshot_.graph && structure_snapshot_.graph->ids.size() > kLargeMap;
  if (!structure_snapshot_.graph || !is_large || frame->index % kLargeMapSnapshotFrames == 0)
    structure_snapshot_ = structure_.snapshot(options_.submaps);
  frame->graph = structure_snapshot_.graph;
  frame->submaps = structure_snapshot_.submaps;
}

/// Direction and inverse depth, in the camera, of visible features of known depth.
std::vector<Tracker::Implementation::DepthSample> Tracker::Implementation::knownDepths(
    const std::vector<VisibleFeature>& visible) const {
  std::vector<DepthSample> known;
  const Eigen::Isometry3d T_camera_world = filter_.camera().poseWorldCamera().inverse();
  for (const VisibleFeature& feature : visible) {
    const FeatureState* state = filter_.find(feature.id);
    if (!state) continue;
    if (state->kind == FeatureKind::kInverseDepth &&
        filter_.sigmaInverseDepth(*state) > kKnownDepthSigma * state->inverse_depth)
      continue;
    const Eigen::Vector3d point = T_camera_world * state->position();
    known.push_back({point.normalized(), 1.0 / point.norm()});
  }
  return known;
}

/// Median inverse depth of the neighbours of a new feature, so that it does not pull the scale,
/// near something and far from it alike; the options' prior while nothing is known.
double Tracker::Implementation::depthPrior(const Eigen::Vector2d& pixel,
                                           std::vector<DepthSample> known) const {
  const auto ray = camera_.unproject(pixel);
  if (!ray || known.size() < kNeighbours) return options_.filter.initial_inverse_depth;
  std::nth_element(known.begin(), known.begin() + (kNeighbours - 1), known.end(),
                   [&ray](const DepthSample& a, const DepthSample& b) {
                     return a.bearing_camera.dot(*ray) > b.bearing_camera.dot(*ray);
                   });
  std::nth_element(
      known.begin(), known.begin() + kNeighbours / 2, known.begin() + kNeighbours,
      [](const DepthSample& a, const DepthSample& b) { return a.inverse_depth < b.inverse_depth; });
  return known[kNeighbours / 2].inverse_depth;
}

/// A new feature, of unknown depth, seen at `pixel` in image `index`; -1 where there is no ray.
FeatureId Tracker::Implementation::addFeature(const Eigen::Vector2d& pixel,
                                              const SourcePatch& patch,
                                              const std::vector<DepthSample>& known_depths,
                                              std::int64_t index) {
  const double relative_sigma =
      options_.filter.initial_sigma_inverse_depth / options_.filter.initial_inverse_depth;
  const double inverse_depth = depthPrior(pixel, known_depths);
  MapFeature feature;
  feature.id = filter_.addInverseDepthFeature(
      camera_, pixel, inverse_depth, relative_sigma * inverse_depth, noise_.typicalSigma_px());
  if (feature.id < 0) return -1;
  feature.patch = patch;
  feature.first_frame = feature.last_matched_frame = index;
  const FeatureId id = feature.id;
  map_.add(std::move(feature));
  return id;
}

/// Where the map's features are in the image.
std::vector<Eigen::Vector2d> Tracker::Implementation::occupiedPixels() const {
  const Eigen::Isometry3d T_camera_world = filter_.camera().poseWorldCamera().inverse();
  std::vector<Eigen::Vector2d> occupied;
  for (const FeatureState& feature : filter_.features()) {
    const Eigen::Vector4d point = homogeneousPosition(feature);
    const auto pixel = camera_.project(T_camera_world.linear() * point.head<3>() +
                                       point.w() * T_camera_world.translation());
    if (pixel && camera_.isInImage(*pixel)) occupied.push_back(*pixel);
  }
  return occupied;
}

int Tracker::Implementation::startFeatures(const cv::Mat& image,
                                           const std::vector<VisibleFeature>& visible, int wanted,
                                           TrackedFrame* frame) {
  wanted = std::min(wanted, mostFeatures() - map_.size());
  if (wanted <= 0) return 0;
  std::vector<Eigen::Vector2d> occupied = occupiedPixels();
  const std::vector<Eigen::Vector2d> frozen = frozenPixels();
  occupied.insert(occupied.end(), frozen.begin(), frozen.end());
  const std::vector<DepthSample> known_depths = knownDepths(visible);
  const double distance_px =
      options_.map.minimum_distance_px * pixelScale(camera_.width(), camera_.height());
  int started = 0;
  std::vector<FeatureMeasurement> first_sights;
  const cv::Mat centres = image_fixed_.sceneCentres(mask_.patchCentres());
  for (const Corner& corner :
       detectCorners(image, occupied, wanted, distance_px, options_.image, centres)) {
    const auto patch = extractSourcePatch(image, corner.pixel, filter_.camera().poseWorldCamera(),
                                          options_.image.source_patch_size_px);
    if (!patch) continue;
    const FeatureId id = addFeature(corner.pixel, *patch, known_depths, frame->index);
    if (id < 0) continue;
    first_sights.push_back({id, corner.pixel, 0.0});
    ++started;
  }
  initialiser_.addFirstSights(first_sights);
  return started;
}

}  // namespace active_matching_slam
