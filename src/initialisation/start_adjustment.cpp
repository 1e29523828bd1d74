#include "active_matching_slam/initialisation/start_adjustment.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/filter/match_motion.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/math/quantile.h"
#include "adjusted_start.h"
#include "start_bundle.h"
#include "start_readings.h"

namespace active_matching_slam {
namespace {

/// Parallax: adjusted first at [sigma of the noise of image points], with every image until it is
/// so much [px], and no more beyond.
constexpr double kFirstParallaxSigmas = 0.3, kEveryImageUpToPx = 2.0, kLastParallaxPx = 20.0;
/// What the first reading, on so little parallax, leads by at least, in what others need to.
constexpr double kFirstLead = 2.0;
constexpr double kGrowth = 1.4;  ///< of parallax or time from one adjustment to the next, then
/// Share of the points: where most are as far as each other, the few that are near tell the motion.
constexpr double kAllButNear = 0.75;
constexpr std::size_t kMostImages = 28;     ///< kept
constexpr std::size_t kParallaxImages = 6;  ///< that it is measured to
constexpr std::size_t kLeastPoints = 8;  ///< of an image that takes part, and common to the first
constexpr int kLeastSightings = 3;       ///< of a feature that takes part
constexpr std::size_t kManyImages = 20;  ///< beyond which an adjustment takes an image more
/// Of an adjustment that another one follows: of some images, and of all.
constexpr double kRoughGain = 1e-2, kGainOnTheWay = 3e-3;
constexpr int kStepsForOneMore = 2;  ///< once all but the last image are adjusted
/// The cleanest features count for this much noise of most, so that the rest tell something too.
constexpr double kCleanestNoise = 0.4;
constexpr double kParallaxToTrustPx = 5.0;  ///< from it on the filter may know more than the images
/// Of what lengths are uncertain by, what their unit is, and the most: logarithms are not linear.
constexpr double kShareOfUnit = 0.1, kMostSigmaOfUnit = 0.01;
/// With so much parallax, a reading that leads by so many times what it needs to is settled.
constexpr double kSettlingLead = 20.0, kSettlingParallaxPx = 2.0;

const FeatureMeasurement* find(const std::vector<FeatureMeasurement>& measurements, FeatureId id) {
  const auto it =
      std::lower_bound(measurements.begin(), measurements.end(), id,
                       [](const FeatureMeasurement& m, FeatureId i) { return m.id < i; });
  return it != measurements.end() && it->id == id ? &*it : nullptr;
}

std::vector<Eigen::Vector2d> zeros(std::size_t count) {
  return std::vector<Eigen::Vector2d>(count, Eigen::Vector2d::Zero());
}

/// Of the measurements whose noise is known; 0 without any.
double medianSigma(const std::vector<FeatureMeasurement>& measurements) {
  std::vector<double> known_px;
  for (const FeatureMeasurement& m : measurements)
    if (m.sigma_px > 0.0) known_px.push_back(m.sigma_px);
  return medianOf(std::move(known_px));
}

/// The same feature, anchored at the origin.
FeatureState seenFromOrigin(const FeatureState& feature) {
  FeatureState seen = feature;
  const bool is_point = feature.kind == FeatureKind::kPoint;
  const double weight = is_point ? 1.0 : feature.inverse_depth;
  const Eigen::Vector3d ray =
      is_point ? feature.point_world : weight * feature.anchor_world + feature.bearing_world;
  seen.kind = FeatureKind::kInverseDepth;
  seen.anchored_at_origin = true;
  seen.anchor_world.setZero();
  seen.bearing_world = ray.normalized();
  seen.inverse_depth = weight / ray.norm();
  seen.tangent_world = seen.bearing_world.unitOrthogonal();
  return seen;
}

/// Whether every image shows enough, and shares enough with the one before to hang together.
bool isConnected(const Bundle& bundle) {
  std::vector<bool> before(bundle.features.size());
  for (std::size_t k = 0; k < bundle.observations.size(); ++k) {
    std::vector<bool> here(bundle.features.size());
    std::size_t common = 0;
    for (const BundleObservation& o : bundle.observations[k]) {
      here[o.feature] = true;
      common += k == 0 || before[o.feature];
    }
    if (common < kLeastPoints) return false;
    before.swap(here);
  }
  return true;
}

/// Angle [px] between two images that no turn explains, of all points but those with the largest;
/// of noise alone it would be about the median. Empty when they share too little.
std::optional<double> parallaxBetween(const CameraModel& model,
                                      const std::vector<FeatureMeasurement>& from,
                                      const std::vector<FeatureMeasurement>& to) {
  Bundle pair;
  pair.cameras.resize(2);
  pair.observations.resize(2);
  for (const FeatureMeasurement& m : to) {
    const FeatureMeasurement* first = find(from, m.id);
    const auto ray = first ? model.unproject(first->pixel) : std::nullopt;
    if (!ray) continue;
    FeatureState feature;
    feature.bearing_world = ray->normalized();
    pair.observations[1].push_back({static_cast<int>(pair.features.size()), m.pixel});
    pair.features.push_back(feature);
  }
  if (pair.features.size() < kLeastPoints) return std::nullopt;
  alignRotation(model, 1, &pair);
  const Eigen::Matrix3d R = pair.cameras[1].q_world_camera.toRotationMatrix();
  std::vector<double> angles;
  for (const BundleObservation& o : pair.observations[1])
    if (const auto ray = model.unproject(o.pixel))
      angles.push_back((R * ray->normalized() - pair.features[o.feature].bearing_world).norm());
  const double of_noise = std::sqrt(std::log(1.0 - kAllButNear) / std::log(0.5));  // Rayleigh's
  return quantileOf(std::move(angles), kAllButNear) / of_noise * model.calibration().fx;
}

}  // namespace

void StartAdjustment::begin(std::int64_t index, const std::vector<FeatureMeasurement>& first) {
  is_active_ = true;
  images_.assign(1, {index, 0.0, CameraState(), first, zeros(first.size())});
  features_.clear();
  adjusted_.clear();
  length_sigma_.reset();
  has_left_first_ = is_settled_ = false;
  least_motion_px_ = 1.0;
  last_parallax_px_ = next_parallax_px_ = 0.0;
  age_ = last_age_ = 0;
  chosen_.reset();
}

void StartAdjustment::addFirstSights(const std::vector<FeatureMeasurement>& measurements) {
  if (!is_active_ || images_.empty()) return;
  auto& known = images_.back().measurements;
  known.insert(known.end(), measurements.begin(), measurements.end());
  images_.back().speeds.resize(known.size(), Eigen::Vector2d::Zero());
}

void StartAdjustment::add(std::int64_t index, double interval_s, const Ekf& filter,
                          const std::vector<FeatureMeasurement>& measurements) {
  if (!is_active_) return;
  ++age_;
  rememberFeatures(filter);
  Image image{index,
              interval_s,
              filter.camera(),
              measurements,
              zeros(measurements.size()),
              medianSigma(measurements)};
  Image& before = images_.back();
  for (std::size_t i = 0; interval_s > 0.0 && i < measurements.size(); ++i) {
    const FeatureMeasurement* same = find(before.measurements, measurements[i].id);
    if (same == nullptr) continue;
    image.speeds[i] = (measurements[i].pixel - same->pixel) / interval_s;
    Eigen::Vector2d& speed = before.speeds[same - before.measurements.data()];
    speed = speed.isZero(0.0) ? image.speeds[i] : Eigen::Vector2d(0.5 * (speed + image.speeds[i]));
  }
  images_.push_back(std::move(image));
  thinOut();
}

void StartAdjustment::rescale(double factor) {
  for (Image& image : images_) image.camera.position_world *= factor;
  for (FeatureState& feature : features_) feature.rescale(factor);
}

void StartAdjustment::rememberFeatures(const Ekf& filter) {
  std::vector<FeatureState> known = filter.features();
  for (const FeatureState& feature : features_)
    if (filter.find(feature.id) == nullptr &&
        std::any_of(images_.begin(), images_.end(), [&feature](const Image& image) {
          return find(image.measurements, feature.id) != nullptr;
        }))
      known.push_back(feature);
  std::sort(known.begin(), known.end(),
            [](const FeatureState& a, const FeatureState& b) { return a.id < b.id; });
  features_ = std::move(known);
}

/// The last image but two goes when it shows nothing new; all but every other go when there are too
/// many.
void StartAdjustment::thinOut() {
  const std::size_t n = images_.size();
  if (n >= 4 && (images_[n - 3].measurements.size() < kLeastPoints ||
                 quantileOf(matchMotions(images_[n - 4].measurements, images_[n - 3].measurements),
                            kAllButNear) < least_motion_px_))
    images_.erase(images_.end() - 3);
  if (images_.size() <= kMostImages) return;
  least_motion_px_ *= 2.0;
  std::vector<Image> kept;
  for (std::size_t i = 0; i < images_.size(); ++i)
    if (i % 2 == 0 || i + 2 >= images_.size()) kept.push_back(std::move(images_[i]));
  images_ = std::move(kept);
}

/// The most of the last image to some of those before that share enough with it: what is near may
/// have come later than the first. Empty when none does.
std::optional<double> StartAdjustment::parallax(const CameraModel& model) {
  std::optional<double> most_px;
  const std::size_t step = images_.size() / kParallaxImages + 1;
  for (std::size_t i = 0; i + 2 < images_.size(); i += step) {
    const auto parallax_px =
        parallaxBetween(model, images_[i].measurements, images_.back().measurements);
    if (parallax_px) most_px = std::max(most_px.value_or(0.0), *parallax_px);
    has_left_first_ |= i == 0 && !parallax_px;
  }
  return most_px;
}

/// Whether parallax is more than noise, and so little that each image tells more, or it or time
/// have grown enough since last asked with so much.
bool StartAdjustment::isTime(double parallax_px, double sigma_px) {
  const bool has_aged = last_age_ > 0 && age_ > kGrowth * last_age_;
  if (parallax_px < kFirstParallaxSigmas * sigma_px) return false;
  if (parallax_px > kEveryImageUpToPx && parallax_px < next_parallax_px_ && !has_aged) return false;
  next_parallax_px_ = std::max(next_parallax_px_, kGrowth * parallax_px);
  last_age_ = age_;
  return true;
}

/// Standard deviation of each feature's matches, in that of most of its image, as the last image
/// with it had it.
std::vector<double> StartAdjustment::noiseOfFeatures(const std::vector<FeatureId>& ids) const {
  std::vector<double> noise(ids.size(), 1.0);
  for (const Image& image : images_)
    for (const FeatureMeasurement& m : image.measurements) {
      const auto it = std::lower_bound(ids.begin(), ids.end(), m.id);
      if (it != ids.end() && *it == m.id && m.sigma_px > 0.0)
        noise[it - ids.begin()] = std::max(kCleanestNoise, m.sigma_px / image.sigma_px);
    }
  return noise;
}

Bundle StartAdjustment::makeBundle(const CameraModel& model, std::vector<FeatureId>* ids) const {
  Bundle bundle;
  for (const FeatureState& feature : features_) {
    const auto sightings = std::count_if(
        images_.begin(), images_.end(),
        [&feature](const Image& image) { return find(image.measurements, feature.id) != nullptr; });
    if (sightings < kLeastSightings) continue;
    ids->push_back(feature.id);
    bundle.features.push_back(seenFromOrigin(feature));
  }
  const std::vector<double> of_features = noiseOfFeatures(*ids);
  for (std::size_t k = 0; k < images_.size(); ++k) {
    const Image& image = images_[k];
    bundle.cameras.push_back(image.camera);
    bundle.observations.emplace_back();
    for (std::size_t i = 0; i < image.measurements.size(); ++i) {
      const FeatureMeasurement& m = image.measurements[i];
      const auto it = std::lower_bound(ids->begin(), ids->end(), m.id);
      if (it == ids->end() || *it != m.id) continue;
      BundleObservation o{static_cast<int>(it - ids->begin()), m.pixel};
      o.noise = of_features[o.feature];
      o.inverse_shape = m.noise_shape.inverse();
      o.d_calibration << rowShare(model, m.pixel.y()) * image.speeds[i],
          model.pixelByCorrection(m.pixel);
      bundle.observations.back().push_back(o);
    }
  }
  return bundle;
}

/// A step an image, so that none takes long: which reading, what of it; with many images, what
/// noise in between.
std::optional<AdjustedStart> StartAdjustment::adjust(const CameraModel& model, const Ekf& filter) {
  if (!is_active_ || images_.size() < 4) return std::nullopt;
  if (!chosen_) {
    const auto parallax_px = parallax(model);
    if (!parallax_px) end();
    if (!parallax_px || !isTime(*parallax_px, filter.options().sigma_px)) return std::nullopt;
    chosen_ = chooseReading(model, filter, *parallax_px);
    if (!chosen_ && *parallax_px >= kLastParallaxPx) end();
    return std::nullopt;
  }
  const Reading chosen = *std::exchange(chosen_, std::nullopt);
  auto weighed = weigh(model, filter, chosen);
  if (weighed && chosen.adjusted != Adjusted::kAllByTheirNoise && images_.size() > kManyImages) {
    chosen_ = std::move(weighed->reading);
    return std::nullopt;
  }
  if (chosen.parallax_px >= kLastParallaxPx) end();
  return weighed ? adopt(model, filter, *std::move(weighed)) : std::nullopt;
}

/// What the filter believes and its opposites are told apart. Empty when none is clearly the best.
/// Once that is settled, what it believes, adjusted by the noise assumed; empty when things move or
/// matches lie.
std::optional<StartAdjustment::Reading> StartAdjustment::chooseReading(const CameraModel& model,
                                                                       const Ekf& filter,
                                                                       double parallax_px) const {
  Reading chosen;
  chosen.parallax_px = parallax_px;
  chosen.bundle = makeBundle(model, &chosen.ids);
  if (!isConnected(chosen.bundle)) return std::nullopt;
  const BundleOptions options = startOptions(filter.options());
  chooseUnit(options, &chosen.bundle);  // a known scale may have been set
  for (const Image& image : images_) chosen.images.push_back(image.index);
  if (is_settled_) {
    BundleOptions settled = withDepthsOf(chosen.bundle, options);
    if (images_.size() > kManyImages) settled.least_gain = kGainOnTheWay;
    const double cost = adjustBundle(model, settled, &chosen.bundle);
    if (costsTooMuch(cost, chosen.bundle)) return std::nullopt;
    chosen.adjusted = Adjusted::kAllImages;
    return chosen;
  }
  auto best = bestReading(model, options, chosen.bundle, areDepthsGuessed());
  if (!best || (areDepthsGuessed() && best->lead < kFirstLead)) return std::nullopt;
  chosen.bundle = std::move(best->bundle);
  chosen.lead = best->lead;
  return chosen;
}

/// All images kept, as `chosen` reads those that it has; others moved as the last of them, and
/// features that it has not where the filter has them.
Bundle StartAdjustment::continued(const Reading& chosen, const Bundle& believed,
                                  const std::vector<FeatureId>& ids) const {
  Bundle all = believed;
  all.calibration = chosen.bundle.calibration;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto it = std::lower_bound(chosen.ids.begin(), chosen.ids.end(), ids[i]);
    if (it != chosen.ids.end() && *it == ids[i])
      all.features[i] = chosen.bundle.features[it - chosen.ids.begin()];
  }
  Eigen::Isometry3d correction = Eigen::Isometry3d::Identity();
  for (std::size_t k = 0; k < images_.size(); ++k) {
    const auto it = std::lower_bound(chosen.images.begin(), chosen.images.end(), images_[k].index);
    if (it != chosen.images.end() && *it == images_[k].index) {
      all.cameras[k] = chosen.bundle.cameras[it - chosen.images.begin()];
      correction =
          all.cameras[k].poseWorldCamera() * believed.cameras[k].poseWorldCamera().inverse();
      continue;
    }
    all.cameras[k].setPoseWorldCamera(correction * believed.cameras[k].poseWorldCamera());
  }
  return all;
}

/// All images kept, as `chosen` reads them, adjusted by the noise that they show.
std::optional<StartAdjustment::Weighed> StartAdjustment::weigh(const CameraModel& model,
                                                               const Ekf& filter,
                                                               const Reading& chosen) const {
  Weighed all;
  Reading& reading = all.reading;
  reading.parallax_px = chosen.parallax_px;
  reading.lead = chosen.lead;
  reading.adjusted = Adjusted::kAllByTheirNoise;
  for (const Image& image : images_) reading.images.push_back(image.index);
  all.believed = makeBundle(model, &reading.ids);
  if (!isConnected(all.believed)) return std::nullopt;
  reading.bundle = all.believed;
  chooseUnit(startOptions(filter.options()), &reading.bundle);  // that of `chosen`
  reading.bundle = continued(chosen, reading.bundle, reading.ids);
  all.options = withDepthsOf(reading.bundle, startOptions(filter.options()));
  if (chosen.adjusted == Adjusted::kSomeImages) {
    BundleOptions roughly = all.options;
    roughly.least_gain = kRoughGain;
    adjustBundle(model, roughly, &reading.bundle);
  }
  if (chosen.adjusted == Adjusted::kAllByTheirNoise) {
    all.options.max_iterations = kStepsForOneMore;
  } else if (images_.size() > kManyImages) {
    all.options.least_gain = kGainOnTheWay;
  }
  adjustByItsNoise(model, &all.options, &reading.bundle, &all.believed, &reading.ids);
  return all;
}

/// The filter's state by what was weighed, unless the filter knows more.
std::optional<AdjustedStart> StartAdjustment::adopt(const CameraModel& model, const Ekf& filter,
                                                    Weighed weighed) {
  Reading& reading = weighed.reading;
  const bool is_refinement = last_parallax_px_ >= kParallaxToTrustPx;
  // The unit of length: the mean of log depths stays, in which each counts what is now known of it.
  Eigen::VectorXd shares = depthShares(model, weighed.options, reading.bundle);
  for (std::size_t i = 0; i < reading.ids.size(); ++i)
    if (filter.find(reading.ids[i]) == nullptr) shares[static_cast<Eigen::Index>(i)] = 0.0;
  shares /= shares.sum();
  // Of depths that were guessed only the middle means something.
  rescaleBundle(length_sigma_ ? depthFactor(shares, weighed.believed, reading.bundle)
                              : medianDepthFactor(weighed.believed, reading.bundle),
                &reading.bundle);
  const double sigma = relativeLengthSigma(filter.camera().position_world,
                                           filter.cameraCovariance().topLeftCorner<3, 3>());
  const double length_sigma = std::min(length_sigma_.value_or(1.0), sigma);  // 1: not finite
  auto start = makeAdjustedStart(model, filter, weighed.options, reading.bundle, reading.ids,
                                 shares, std::min(kShareOfUnit * length_sigma, kMostSigmaOfUnit),
                                 images_.back().interval_s);
  if (!start) return std::nullopt;
  length_sigma_ = length_sigma;
  if (reading.parallax_px >= kParallaxToTrustPx && knowsMore(filter, *start)) {
    end();
    return std::nullopt;
  }
  start->is_refinement = is_refinement;
  takeOver(reading, &*start);
  is_settled_ |= reading.lead > kSettlingLead && reading.parallax_px > kSettlingParallaxPx;
  last_parallax_px_ = reading.parallax_px;
  return start;
}

/// Cameras and features are from now on where `reading` has them; `start` hears of the moves.
void StartAdjustment::takeOver(const Reading& reading, AdjustedStart* start) {
  for (std::size_t k = 0; k < images_.size(); ++k) {
    start->moves.push_back({images_[k].index, images_[k].camera.poseWorldCamera(),
                            reading.bundle.cameras[k].poseWorldCamera()});
    images_[k].camera = reading.bundle.cameras[k];
  }
  adjusted_ = reading.ids;
  auto feature = features_.begin();
  for (std::size_t i = 0; i < reading.ids.size(); ++i) {
    while (feature->id != reading.ids[i]) ++feature;  // both ascend
    *feature = reading.bundle.features[i];
  }
}

}  // namespace active_matching_slam
