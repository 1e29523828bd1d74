#include "active_matching_slam/map/feature_map.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/image/surface_slope.h"
#include "active_matching_slam/math/quantile.h"

namespace active_matching_slam {
namespace {

/// Cells by which measured features are spread. Derivation: square in an image of 4:3, and about as
/// many as features are measured in a frame by default.
constexpr int kGridColumns = 8, kGridRows = 6;

/// Forgetting factor of the recent match rate and of the drift, a search. Derivation: its memory of
/// 1 / (1 - 0.9) = 10 searches is MapOptions::retire_after_attempts by default.
constexpr double kForgetting = 0.9;
/// Matches from which on a feature's drift counts. Derivation: the memory of its average.
constexpr int kMinimumMatchesForDrift = 10;
/// Features of which the median drift is taken. Derivation: a median of 8 stands three outliers.
constexpr std::size_t kMinimumFeaturesForMedian = 8;
/// Largest drift, in the median of all. Derivation: of errors that are isotropic Gaussian, one in
/// 2^(3.5^2), about 5000, is longer.
constexpr double kMaximumRelativeDrift = 3.5;
/// The same at least, whatever the median [px]: the bias of sub-pixel alignment, which goes by
/// pixels and not by the image's size. Cost: lower, features that are points are retired and must
/// be started anew.
constexpr double kMaximumDriftPx = 0.3;
/// Matched of the features searched in an image, as a fraction of one, below which the image is at
/// fault. Derivation: an image that is half occluded, with some misses besides, is not.
constexpr int kInverseFaultyFraction = 3;

/// Memory of what a feature tells of the camera [s]. Cost: with less, a glance aside empties the
/// map of what is behind; with more, it keeps features of where the camera was.
constexpr double kInformationMemory_s = 2.0;

bool byId(const MapFeature& a, FeatureId id) { return a.id < id; }

Eigen::Vector2d medianInnovation(const std::vector<SearchRecord>& searches) {
  std::vector<double> x, y;
  for (const SearchRecord& search : searches) {
    if (!search.matched) continue;
    x.push_back(search.innovation_px.x());
    y.push_back(search.innovation_px.y());
  }
  return {medianOf(std::move(x)), medianOf(std::move(y))};
}

/// The feature among some in the order of their ids, constant or not; null when unknown.
template <class Features>
auto findIn(Features& features, FeatureId id) -> decltype(features.data()) {
  const auto it = std::lower_bound(features.begin(), features.end(), id, byId);
  return it != features.end() && it->id == id ? &*it : nullptr;
}

}  // namespace

const MapFeature* FeatureMap::find(FeatureId id) const { return findIn(features_, id); }

MapFeature* FeatureMap::findMutable(FeatureId id) { return findIn(features_, id); }

void FeatureMap::clear() { features_.clear(); }

void FeatureMap::add(MapFeature feature) {
  features_.insert(std::lower_bound(features_.begin(), features_.end(), feature.id, byId),
                   std::move(feature));
}

void FeatureMap::retire(const std::vector<FeatureId>& ids) {
  const auto gone = [&](const MapFeature& f) {
    return std::find(ids.begin(), ids.end(), f.id) != ids.end();
  };
  const auto end = std::remove_if(features_.begin(), features_.end(), gone);
  retired_total_ += std::distance(end, features_.end());
  features_.erase(end, features_.end());
}

std::vector<MapFeature> FeatureMap::take(const std::vector<FeatureId>& ids) {
  std::vector<MapFeature> taken, kept;
  for (MapFeature& feature : features_) {
    const bool is_taken = std::find(ids.begin(), ids.end(), feature.id) != ids.end();
    (is_taken ? taken : kept).push_back(std::move(feature));
  }
  features_.swap(kept);
  return taken;
}

void FeatureMap::rescale(double factor) {
  for (MapFeature& feature : features_) feature.patch.T_world_camera.translation() *= factor;
}

void FeatureMap::movePatches(
    const std::function<Eigen::Isometry3d(std::int64_t, const Eigen::Isometry3d&)>& moved) {
  for (MapFeature& feature : features_)
    feature.patch.T_world_camera = moved(feature.first_frame, feature.patch.T_world_camera);
}

std::vector<VisibleFeature> FeatureMap::visible(const Ekf& filter, const CameraModel& camera,
                                                const MapOptions& options, double border_px) const {
  std::vector<VisibleFeature> result;
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  const double maximum_angle = options.maximum_view_angle_deg * M_PI / 180.0;
  for (const MapFeature& feature : features_) {
    const FeatureState* state = filter.find(feature.id);
    if (!state) continue;
    const auto view =
        predictFlatView(feature.patch, camera, T_world_camera, homogeneousPosition(*state));
    if (!view || !camera.isInImage(view->pixel, border_px)) continue;
    if (view->view_angle_rad > maximum_angle || view->scale < options.minimum_scale ||
        view->scale > options.maximum_scale)
      continue;
    result.push_back({feature.id, *view});
  }
  return result;
}

std::vector<VisibleFeature> FeatureMap::choose(const std::vector<VisibleFeature>& visible,
                                               const CameraModel& camera, int wanted) const {
  if (static_cast<int>(visible.size()) <= wanted) return visible;
  struct Entry {
    double rate;
    const VisibleFeature* feature;
  };
  std::vector<std::vector<Entry>> cells(kGridColumns * kGridRows);
  std::vector<VisibleFeature> chosen;
  for (const VisibleFeature& v : visible) {
    const MapFeature& feature = *find(v.id);
    if (feature.known) {
      chosen.push_back(v);
      continue;
    }
    const auto cell = [](double x, int size, int cells) {
      return std::clamp(static_cast<int>(x * cells / size), 0, cells - 1);
    };
    const int column = cell(v.view.pixel.x(), camera.width(), kGridColumns);
    const int row = cell(v.view.pixel.y(), camera.height(), kGridRows);
    cells[row * kGridColumns + column].push_back({feature.recent_rate, &v});
  }
  for (auto& cell : cells)
    std::stable_sort(cell.begin(), cell.end(),
                     [](const Entry& a, const Entry& b) { return a.rate > b.rate; });
  for (std::size_t rank = 0; static_cast<int>(chosen.size()) < wanted; ++rank)
    for (const auto& cell : cells)
      if (rank < cell.size() && static_cast<int>(chosen.size()) < wanted)
        chosen.push_back(*cell[rank].feature);
  std::sort(chosen.begin(), chosen.end(),
            [](const VisibleFeature& a, const VisibleFeature& b) { return a.id < b.id; });
  return chosen;
}

void FeatureMap::record(const std::vector<SearchRecord>& searches, std::int64_t frame) {
  const auto matched = std::count_if(searches.begin(), searches.end(),
                                     [](const SearchRecord& s) { return s.matched; });
  const bool image_at_fault =
      kInverseFaultyFraction * matched < static_cast<std::ptrdiff_t>(searches.size());
  const Eigen::Vector2d common = medianInnovation(searches);
  for (const SearchRecord& search : searches) {
    MapFeature* feature = findMutable(search.id);
    if (!feature || (!search.matched && image_at_fault)) continue;
    ++feature->attempts;
    feature->rates.add(search.matched, search.matches, search.pixels);
    feature->recent_rate =
        kForgetting * feature->recent_rate + (search.matched ? 1.0 - kForgetting : 0.0);
    if (search.matched) {
      ++feature->successes;
      feature->last_matched_frame = frame;
      feature->drift_px =
          kForgetting * feature->drift_px + (1.0 - kForgetting) * (search.innovation_px - common);
    }
  }
}

void FeatureMap::learnSlope(const VisibleFeature& feature, const Template& expected,
                            const cv::Mat& image, const Eigen::Vector2d& pixel) {
  if (MapFeature* known = findMutable(feature.id))
    active_matching_slam::learnSlope(image, pixel, expected, feature.view, &known->patch);
}

void FeatureMap::retakePatch(FeatureId id, const SourcePatch& patch) {
  if (MapFeature* feature = findMutable(id)) feature->patch = patch;
}

void FeatureMap::learnNoise(FeatureId id, const Eigen::Vector2d& residual) {
  if (MapFeature* feature = findMutable(id)) feature->noise.learn(residual);
}

double FeatureMap::expectedMatches(const std::vector<VisibleFeature>& visible) const {
  double sum = 0.0;
  for (const VisibleFeature& feature : visible) sum += find(feature.id)->recent_rate;
  return sum;
}

std::vector<FeatureId> FeatureMap::failing(const MapOptions& options) const {
  std::vector<FeatureId> ids;
  for (const MapFeature& feature : features_)
    if (!feature.known && feature.attempts >= options.retire_after_attempts &&
        (feature.successes < options.retire_success_ratio * feature.attempts ||
         feature.recent_rate < 0.5 * options.retire_success_ratio))
      ids.push_back(feature.id);
  return ids;
}

std::vector<FeatureId> FeatureMap::drifting() const {
  std::vector<double> lengths;
  for (const MapFeature& feature : features_)
    if (feature.successes >= kMinimumMatchesForDrift) lengths.push_back(feature.drift_px.norm());
  if (lengths.size() < kMinimumFeaturesForMedian) return {};
  const double limit = std::max(kMaximumRelativeDrift * medianOf(lengths), kMaximumDriftPx);
  std::vector<FeatureId> ids;
  for (const MapFeature& feature : features_)
    if (!feature.known && feature.successes >= kMinimumMatchesForDrift &&
        feature.drift_px.norm() > limit)
      ids.push_back(feature.id);
  return ids;
}

void FeatureMap::recordInformation(const std::vector<VisibleFeature>& visible,
                                   const std::vector<double>& bits,
                                   const std::vector<FeatureId>& behind_mask, double interval_s) {
  const double kept = std::exp(-std::max(interval_s, 0.0) / kInformationMemory_s);
  std::size_t next = 0;
  for (MapFeature& feature : features_) {
    feature.behind_mask = std::binary_search(behind_mask.begin(), behind_mask.end(), feature.id);
    if (feature.behind_mask) continue;
    const bool is_visible = next < visible.size() && visible[next].id == feature.id;
    const double now = is_visible ? bits[next++] : 0.0;
    const bool is_known = feature.information_bits >= 0.0;
    feature.information_bits =
        is_known ? kept * feature.information_bits + (1.0 - kept) * now : now;
  }
}

std::vector<FeatureId> FeatureMap::leastInformative(int count) const {
  std::vector<const MapFeature*> candidates;
  for (const MapFeature& feature : features_)
    if (!feature.known && !feature.behind_mask && feature.information_bits >= 0.0)
      candidates.push_back(&feature);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const MapFeature* a, const MapFeature* b) {
                     return a->information_bits < b->information_bits;
                   });
  std::vector<FeatureId> ids;
  for (int i = 0; i < count && i < static_cast<int>(candidates.size()); ++i)
    ids.push_back(candidates[i]->id);
  return ids;
}

std::vector<FeatureId> FeatureMap::leastUseful(const Ekf& filter, int count) const {
  struct Entry {
    double uselessness;
    FeatureId id;
  };
  std::vector<Entry> entries;
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  for (const MapFeature& feature : features_) {
    const FeatureState* state = filter.find(feature.id);
    if (feature.known || !state) continue;
    const Eigen::Vector4d point = homogeneousPosition(*state);
    const Eigen::Vector3d ray = point.head<3>() - point.w() * T_world_camera.translation();
    const double cosine = ray.normalized().dot(T_world_camera.linear().col(2));
    const double off_axis_rad = std::acos(std::clamp(cosine, -1.0, 1.0));
    const double baseline =
        (T_world_camera.translation() - feature.patch.T_world_camera.translation()).norm();
    const double inverse_distance = point.w() / std::max(ray.norm(), 1e-12);
    const double failure_rate = 1.0 - feature.recent_rate;
    entries.push_back({off_axis_rad + baseline * inverse_distance + failure_rate, feature.id});
  }
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.uselessness > b.uselessness; });
  std::vector<FeatureId> ids;
  for (int i = 0; i < count && i < static_cast<int>(entries.size()); ++i)
    ids.push_back(entries[i].id);
  return ids;
}

}  // namespace active_matching_slam
