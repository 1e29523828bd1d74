#include "frame_noise.h"

#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "active_matching_slam/filter/match_motion.h"

namespace active_matching_slam {
namespace {

/// Redundancy number of a match (share of its variance that the update leaves to its residual)
/// below which the residual is not learnt from: the state has followed nearly all of it.
constexpr double kMinimumRedundancy = 0.1;
/// Variance inflation of matches that the initialiser will use again, for all but the camera's last
/// motion: they must not count twice.
constexpr double kInflationWhileAdjusted = 1000.0;
/// Factor on their sigma for the camera's last motion, which then has their correlated errors to
/// itself. Fitted to the NEES of rendered runs.
constexpr double kSigmaWhileAdjusted = 1.27;

}  // namespace

void FrameNoise::addProcessNoise(const CameraModel& camera, double interval_s,
                                 const FeatureMap& map, Ekf* filter) const {
  std::vector<double> relative;  // to the median landmark's
  for (const FeatureState& state : filter->features()) {
    const MapFeature& feature = *map.find(state.id);
    // Known points hold the scale: no more of that is given up than for others.
    relative.push_back(feature.known ? 1.0 : match_noise_.wanderLikeMost(feature.noise));
  }
  filter->letCornersWander(camera, interval_s, relative);
}

void FrameNoise::weigh(const FilterOptions& options,
                       const std::function<bool(FeatureId)>& is_adjusted, FeatureMap* map,
                       std::vector<FeatureMeasurement>* measurements) {
  std::vector<double> fit_sigmas_px;
  for (const FeatureMeasurement& measurement : *measurements)
    if (measurement.sigma_px > 0.0) fit_sigmas_px.push_back(measurement.sigma_px);
  match_noise_.see(std::move(fit_sigmas_px));
  match_noise_.seeMotion(matchMotions(last_, *measurements));
  for (FeatureMeasurement& measurement : *measurements) {
    map->seeNoise(measurement.id, measurement.sigma_px / match_noise_.ofImage());
    const MapFeature& feature = *map->find(measurement.id);
    measurement.sigma_px = match_noise_.sigma_px(options, feature.noise);
    measurement.lasting = match_noise_.lastingLikeMost(feature.noise);
    if (is_adjusted(measurement.id)) {
      measurement.repetitions = kInflationWhileAdjusted;
      measurement.sigma_px *= kSigmaWhileAdjusted;
    } else if (!feature.known) {  // known points don't depend on what their first images showed
      measurement.repetitions = match_noise_.repetitions(feature.noise);
    }
  }
  last_ = *measurements;
}

void FrameNoise::learn(const UpdateReport& report,
                       const std::vector<FeatureMeasurement>& measurements, FeatureMap* map) {
  const Eigen::Vector2d unknown =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<Eigen::Vector2d> residuals_px;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const double redundancy = report.noise_left[i];
    const double normaliser =
        std::sqrt(redundancy) * match_noise_.likeMost(map->find(measurements[i].id)->noise);
    residuals_px.push_back(redundancy > kMinimumRedundancy
                               ? Eigen::Vector2d(report.left_px[i] / normaliser)
                               : unknown);
  }
  const double sigma_px = match_noise_.learn(residuals_px);
  if (!(sigma_px > 0.0)) return;
  std::vector<double> correlated;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const FeatureId id = measurements[i].id;
    map->learnNoise(id, residuals_px[i], sigma_px);
    if (const auto variance = map->find(id)->noise.lasting()) correlated.push_back(*variance);
  }
  match_noise_.learnLasting(std::move(correlated));
}

}  // namespace active_matching_slam
