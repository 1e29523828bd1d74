#include "active_matching_slam/initialisation/keyframes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "active_matching_slam/filter/match_motion.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/math/quantile.h"

namespace active_matching_slam {
namespace {

/// Of the points, for parallax and motion: where most are as far as each other, the few that are
/// near show the translation. Standard: the upper quartile.
constexpr double kQuantile = 0.75;
constexpr int kParallaxKeyframes = 6;  ///< Cost: that parallax is measured to

std::vector<Eigen::Vector2d> zeros(std::size_t count) {
  return std::vector<Eigen::Vector2d>(count, Eigen::Vector2d::Zero());
}

std::size_t commonPoints(const Keyframe& a, const Keyframe& b) {
  return matchMotions(a.measurements, b.measurements).size();
}

/// Two keyframes as a bundle of those points of `to` that `from` shows, at infinity, with the
/// rotation between the two.
Bundle rotationBetween(const CameraModel& model, const Keyframe& from, const Keyframe& to) {
  Bundle pair;
  pair.cameras.resize(2);
  pair.observations.resize(2);
  for (const FeatureMeasurement& m : to.measurements) {
    const FeatureMeasurement* first = from.find(m.id);
    const auto ray = first ? model.unproject(first->pixel) : std::nullopt;
    if (!ray) continue;
    FeatureState feature;
    feature.bearing_world = ray->normalized();
    pair.observations[1].push_back({static_cast<int>(pair.features.size()), m.pixel});
    pair.features.push_back(feature);
  }
  alignRotation(model, 1, &pair);
  return pair;
}

/// See Keyframes::parallax(). Empty when the two share too few points.
std::optional<double> parallaxBetween(const CameraModel& model, const Keyframe& from,
                                      const Keyframe& to, std::size_t minimum_points) {
  const Bundle pair = rotationBetween(model, from, to);
  if (pair.features.size() < minimum_points) return std::nullopt;
  const Eigen::Matrix3d R = pair.cameras[1].q_world_camera.toRotationMatrix();
  std::vector<double> angles;
  for (const BundleObservation& o : pair.observations[1])
    if (const auto ray = model.unproject(o.pixel))
      angles.push_back((R * ray->normalized() - pair.features[o.feature].bearing_world).norm());
  const double median_of_noise = std::sqrt(std::log(1.0 - kQuantile) / std::log(0.5));  // Rayleigh
  return quantileOf(std::move(angles), kQuantile) / median_of_noise;
}

/// Anchored at the origin, along `ray_world` (any length) from `position_world` and at the depth
/// 1 / `inverse_depth`.
FeatureState featureAlong(const Eigen::Vector3d& ray_world, const Eigen::Vector3d& position_world,
                          double inverse_depth) {
  FeatureState feature;
  const Eigen::Vector3d ray = ray_world.normalized() + inverse_depth * position_world;
  feature.anchored_at_origin = true;
  feature.bearing_world = ray.normalized();
  feature.inverse_depth = inverse_depth / ray.norm();
  feature.tangent_world = feature.bearing_world.unitOrthogonal();
  return feature;
}

/// alignRotation() to those features that are known.
void alignToKnown(const CameraModel& model, int index, const std::vector<bool>& is_known,
                  Bundle* bundle) {
  auto& observations = bundle->observations[index];
  auto known = observations;
  known.erase(
      std::remove_if(known.begin(), known.end(),
                     [&is_known](const BundleObservation& o) { return !is_known[o.feature]; }),
      known.end());
  known.swap(observations);
  alignRotation(model, index, bundle);
  known.swap(observations);
}

double medianInverseDepth(const std::vector<FeatureState>& features) {
  std::vector<double> inverse_depths;
  for (const FeatureState& feature : features) inverse_depths.push_back(feature.inverse_depth);
  return medianOf(std::move(inverse_depths));
}

}  // namespace

const FeatureMeasurement* Keyframe::find(FeatureId id) const {
  const auto it =
      std::lower_bound(measurements.begin(), measurements.end(), id,
                       [](const FeatureMeasurement& m, FeatureId i) { return m.id < i; });
  return it != measurements.end() && it->id == id ? &*it : nullptr;
}

void Keyframes::begin(KeyframeMeasurements first) {
  Keyframe keyframe;
  static_cast<KeyframeMeasurements&>(keyframe) = std::move(first);
  keyframe.velocities_px_s = zeros(keyframe.measurements.size());
  keyframes_.assign(1, std::move(keyframe));
  minimum_motion_deg_ = options_.keyframe_motion_deg;
}

void Keyframes::addFirstSights(const std::vector<FeatureMeasurement>& measurements) {
  Keyframe& last = keyframes_.back();
  last.measurements.insert(last.measurements.end(), measurements.begin(), measurements.end());
  last.velocities_px_s.resize(last.measurements.size(), Eigen::Vector2d::Zero());
}

bool Keyframes::add(const CameraModel& model, KeyframeMeasurements image,
                    const Eigen::Isometry3d& T_world_camera) {
  Keyframe keyframe;
  static_cast<KeyframeMeasurements&>(keyframe) = std::move(image);
  Keyframe& before = keyframes_.back();
  if (commonPoints(before, keyframe) < options_.minimum_points) return false;
  keyframe.T_world_camera = T_world_camera;
  keyframe.velocities_px_s = zeros(keyframe.measurements.size());
  const double interval_s = keyframe.stamp_s - before.stamp_s;
  for (std::size_t i = 0; interval_s > 0.0 && i < keyframe.measurements.size(); ++i) {
    const FeatureMeasurement* same = before.find(keyframe.measurements[i].id);
    if (same == nullptr) continue;
    Eigen::Vector2d& velocity = keyframe.velocities_px_s[i];
    velocity = (keyframe.measurements[i].pixel - same->pixel) / interval_s;
    Eigen::Vector2d& there = before.velocities_px_s[same - before.measurements.data()];
    there = there.isZero(0.0) ? velocity : Eigen::Vector2d(0.5 * (there + velocity));
  }
  keyframe.q_rotation_only =
      (before.q_rotation_only * rotationBetween(model, before, keyframe).cameras[1].q_world_camera)
          .normalized();
  keyframes_.push_back(std::move(keyframe));
  cull(model);
  return true;
}

/// The last keyframe but two goes when it moved too little from the one before; every other one
/// when there are too many.
void Keyframes::cull(const CameraModel& model) {
  const std::size_t n = keyframes_.size();
  const double minimum_px = minimum_motion_deg_ * M_PI / 180.0 * model.calibration().fx;
  if (n >= 4 &&
      quantileOf(matchMotions(keyframes_[n - 4].measurements, keyframes_[n - 3].measurements),
                 kQuantile) < minimum_px)
    keyframes_.erase(keyframes_.end() - 3);
  if (keyframes_.size() <= options_.maximum_keyframes) return;
  minimum_motion_deg_ *= 2.0;
  std::vector<Keyframe> kept;
  for (std::size_t i = 0; i < keyframes_.size(); ++i)
    if (i % 2 == 0 || i + 2 >= keyframes_.size()) kept.push_back(std::move(keyframes_[i]));
  keyframes_ = std::move(kept);
}

bool Keyframes::sharesFirst() const {
  return commonPoints(keyframes_.front(), keyframes_.back()) >= options_.minimum_points;
}

void Keyframes::dropUnseen() {
  while (keyframes_.size() > 2 && !sharesFirst() &&
         commonPoints(keyframes_.front(), keyframes_[keyframes_.size() - 2]) <
             options_.minimum_points)
    keyframes_.erase(keyframes_.begin());
}

void Keyframes::rescale(double factor) {
  for (Keyframe& keyframe : keyframes_) keyframe.T_world_camera.translation() *= factor;
}

std::optional<double> Keyframes::parallax(const CameraModel& model) const {
  std::optional<double> largest;
  const int step = size() / kParallaxKeyframes + 1;
  for (int i = 0; i + 2 < size(); i += step) {
    const auto parallax =
        parallaxBetween(model, keyframes_[i], keyframes_.back(), options_.minimum_points);
    if (parallax) largest = std::max(largest.value_or(0.0), *parallax);
  }
  return largest;
}

/// Whether every keyframe shares enough points with the one before.
bool Keyframes::isConnected(const Bundle& bundle) const {
  std::vector<bool> before(bundle.features.size());
  for (std::size_t k = 0; k < bundle.observations.size(); ++k) {
    std::vector<bool> here(bundle.features.size());
    std::size_t common = 0;
    for (const BundleObservation& o : bundle.observations[k]) {
      here[o.feature] = true;
      common += k == 0 || before[o.feature];
    }
    if (common < options_.minimum_points) return false;
    before.swap(here);
  }
  return true;
}

/// Image points of the `chosen` keyframes, of features with enough of them; cameras and features as
/// they are made.
MotionHypothesis Keyframes::observationsOf(const CameraModel& model,
                                           const std::vector<int>& chosen) const {
  std::map<FeatureId, int> sightings;
  // Of a feature's noise its last match says most; of an image's as a whole nothing is assumed
  // here: estimateImageVariances().
  std::map<FeatureId, double> relative_sigmas;
  for (const int k : chosen) {
    std::vector<double> sigmas_px;
    for (const FeatureMeasurement& m : keyframes_[k].measurements) sigmas_px.push_back(m.sigma_px);
    const double median_px = medianOf(std::move(sigmas_px));
    for (const FeatureMeasurement& m : keyframes_[k].measurements) {
      ++sightings[m.id];
      if (m.sigma_px > 0.0 && median_px > 0.0) relative_sigmas[m.id] = m.sigma_px / median_px;
    }
  }
  MotionHypothesis hypothesis;
  for (const auto& [id, count] : sightings)
    if (count >= options_.minimum_sightings) hypothesis.ids.push_back(id);
  Bundle& bundle = hypothesis.bundle;
  bundle.features.resize(hypothesis.ids.size());
  bundle.cameras.resize(chosen.size());
  for (const int k : chosen) {
    const Keyframe& keyframe = keyframes_[k];
    hypothesis.images.push_back(keyframe.image);
    bundle.observations.emplace_back();
    for (std::size_t i = 0; i < keyframe.measurements.size(); ++i) {
      const FeatureMeasurement& m = keyframe.measurements[i];
      const auto it = std::lower_bound(hypothesis.ids.begin(), hypothesis.ids.end(), m.id);
      if (it == hypothesis.ids.end() || *it != m.id) continue;
      BundleObservation o{static_cast<int>(it - hypothesis.ids.begin()), m.pixel};
      if (const auto sigma = relative_sigmas.find(m.id); sigma != relative_sigmas.end())
        o.relative_sigma = sigma->second;
      o.inverse_shape = m.noise_shape.inverse();
      o.d_calibration << rowShare(model, m.pixel.y()) * keyframe.velocities_px_s[i],
          model.pixelByCorrection(m.pixel);
      bundle.observations.back().push_back(o);
    }
  }
  return hypothesis;
}

std::optional<MotionHypothesis> Keyframes::rotationOnly(const CameraModel& model) const {
  const int last = size() - 1, count = static_cast<int>(options_.candidate_keyframes);
  const int step = std::max(1, (last + count - 2) / (count - 1));
  std::vector<int> chosen;
  for (int k = last; k > 0; k -= step) chosen.insert(chosen.begin(), k);
  chosen.insert(chosen.begin(), 0);
  MotionHypothesis hypothesis = observationsOf(model, chosen);
  Bundle& bundle = hypothesis.bundle;
  if (!isConnected(bundle)) return std::nullopt;
  std::vector<bool> is_known(bundle.features.size());
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    CameraState& camera = bundle.cameras[k];
    camera.q_world_camera = keyframes_[chosen[k]].q_rotation_only;
    if (k > 0) alignToKnown(model, static_cast<int>(k), is_known, &bundle);
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto ray = model.unproject(o.pixel);
      if (is_known[o.feature] || !ray) continue;
      is_known[o.feature] = true;
      bundle.features[o.feature] =
          featureAlong(camera.q_world_camera * *ray, camera.position_world, 1.0);
    }
  }
  return hypothesis;
}

/// Where `known` has them; between two of those in proportion to time; after the last by constant
/// velocity. The rotations of others fit the features that are known.
void Keyframes::placeCameras(const CameraModel& model, const MotionHypothesis& known,
                             const std::vector<bool>& is_known, MotionHypothesis* all) const {
  std::vector<CameraState>& cameras = all->bundle.cameras;
  const auto indexOf = [&known](std::int64_t image) {
    const auto it = std::lower_bound(known.images.begin(), known.images.end(), image);
    return it != known.images.end() && *it == image ? static_cast<int>(it - known.images.begin())
                                                    : -1;
  };
  std::vector<int> placed;
  for (int k = 0; k < size(); ++k)
    if (const int there = indexOf(keyframes_[k].image); there >= 0) {
      cameras[k] = known.bundle.cameras[there];
      placed.push_back(k);
    }
  for (int k = 1; k < size(); ++k) {
    if (indexOf(keyframes_[k].image) >= 0) continue;
    // The two placed cameras next to it, or the last two before.
    auto b = std::upper_bound(placed.begin(), placed.end(), k);
    if (b == placed.end()) --b;
    if (b == placed.begin()) ++b;
    const int from = *(b - 1), to = *b;
    const double fraction = (keyframes_[k].stamp_s - keyframes_[from].stamp_s) /
                            (keyframes_[to].stamp_s - keyframes_[from].stamp_s);
    cameras[k].position_world =
        cameras[from].position_world +
        fraction * (cameras[to].position_world - cameras[from].position_world);
    cameras[k].q_world_camera = cameras[k > to ? to : from].q_world_camera;
    alignToKnown(model, k, is_known, &all->bundle);
    placed.insert(std::upper_bound(placed.begin(), placed.end(), k), k);
  }
}

std::optional<MotionHypothesis> Keyframes::extend(const CameraModel& model,
                                                  const MotionHypothesis& known) const {
  std::vector<int> chosen;
  for (int k = 0; k < size(); ++k) chosen.push_back(k);
  MotionHypothesis all = observationsOf(model, chosen);
  Bundle& bundle = all.bundle;
  const bool is_first_known = !known.images.empty() && known.images.front() == all.images.front();
  if (!isConnected(bundle) || !is_first_known || known.images.size() < 2) return std::nullopt;
  bundle.calibration = known.bundle.calibration;
  std::vector<bool> is_known(all.ids.size());
  for (std::size_t i = 0; i < all.ids.size(); ++i) {
    const auto it = std::lower_bound(known.ids.begin(), known.ids.end(), all.ids[i]);
    is_known[i] = it != known.ids.end() && *it == all.ids[i];
    if (is_known[i]) bundle.features[i] = known.bundle.features[it - known.ids.begin()];
  }
  placeCameras(model, known, is_known, &all);
  const double inverse_depth = medianInverseDepth(known.bundle.features);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const CameraState& camera = bundle.cameras[k];
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto ray = model.unproject(o.pixel);
      if (is_known[o.feature] || !ray) continue;
      is_known[o.feature] = true;
      bundle.features[o.feature] =
          featureAlong(camera.q_world_camera * *ray, camera.position_world, inverse_depth);
    }
  }
  return all;
}

}  // namespace active_matching_slam
