#include "frame_noise.h"

#include <cmath>

namespace active_matching_slam {
namespace {

/// Redundancy number of a match below which its residual is not learnt from: the state has followed
/// nearly all of it. Standard: Baarda (1968) calls observations below .1 poorly controlled.
constexpr double kMinimumRedundancy = 0.1;
/// Variance inflation of matches that take part in the bundle adjustment as well: considered, not
/// learnt from twice (Schmidt 1966). Derivation: the limit is infinity; this leaves 1e-10 of R to
/// rounding.
constexpr double kConsidered = 1e6;

}  // namespace

void FrameNoise::setOptions(const FilterOptions& options) {
  options_ = options;
  noise_.setOptions(options);
}

void FrameNoise::predict(const CameraModel& camera, double interval_s, Ekf* filter) {
  noise_.predict(interval_s);
  if (filter) filter->addLandmarkNoise(camera, interval_s, options_.landmark_noise_px);
}

void FrameNoise::weigh(const std::function<bool(FeatureId)>& is_adjusted, const FeatureMap& map,
                       std::vector<FeatureMeasurement>* measurements) {
  fits_.clear();
  for (const FeatureMeasurement& measurement : *measurements)
    fits_.push_back({measurement.sigma_px});
  noise_.observeFits(fits_);
  for (std::size_t i = 0; i < fits_.size(); ++i) {
    FeatureMeasurement& measurement = (*measurements)[i];
    const MapFeature& feature = *map.find(measurement.id);
    measurement.sigma_px = noise_.sigma_px(fits_[i], feature.noise);
    if (is_adjusted(measurement.id)) {
      measurement.variance_inflation = kConsidered;
    } else if (!feature.known) {  // known points don't depend on what their first images showed
      measurement.variance_inflation = noise_.inflation(fits_[i], feature.noise);
    }
  }
}

NoisePrior FrameNoise::prior() const {
  return {noise_.degrees(), options_.minimum_sigma_px * options_.minimum_sigma_px};
}

void FrameNoise::learn(const UpdateReport& report,
                       const std::vector<FeatureMeasurement>& measurements, FeatureMap* map) {
  noise_.learn(report.noise_scale, report.noise_degrees);
  std::vector<double> inflations;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    if (!(report.redundancy[i] > kMinimumRedundancy) || !(fits_[i].sigma_px > 0.0)) continue;
    const double sigma_px = std::sqrt(report.redundancy[i]) * noise_.unscaledSigma_px(fits_[i]);
    map->learnNoise(measurements[i].id, report.residual_px[i] / sigma_px);
    const LandmarkNoise& landmark = map->find(measurements[i].id)->noise;
    if (landmark.hasInflation()) inflations.push_back(landmark.inflation());
  }
  noise_.learnInflation(inflations);
}

}  // namespace active_matching_slam
