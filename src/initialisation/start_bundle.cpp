#include "start_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "bundle_equations.h"
#include "start_readings.h"

namespace active_matching_slam {
namespace {

/// Prior of depths in the end, by how far apart they turned out to be (median).
constexpr double kDepthSpread = 3.5;
constexpr double kOutlierSigmas = 2.0, kLeastOutlierPx = 0.03;
constexpr double kLeastNoisePx = 0.005;  ///< of image points
/// No image point counts for more than so many times what features miss on the whole (median).
constexpr double kMostMiss = 3.0;
/// Points for which an image is taken to be as noisy as most.
constexpr double kPointsLikeOthers = 10.0;

/// Median distance of the inverse depths to one.
double medianDeviation(const Bundle& bundle, double inverse_depth) {
  std::vector<double> deviations;
  for (const FeatureState& feature : bundle.features)
    deviations.push_back(std::abs(feature.inverse_depth - inverse_depth));
  return medianOf(std::move(deviations));
}

/// Takes out features that are no points of the scene: their image points are outliers on the
/// whole. Both bundles have the same features and observations.
void dropWanderers(const CameraModel& model, double outlier_px, Bundle* bundle, Bundle* before,
                   std::vector<FeatureId>* ids) {
  const std::vector<double> errors = featureErrors(model, *bundle);
  std::vector<int> place(errors.size(), -1);
  int kept = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] > outlier_px) continue;
    place[i] = kept;
    bundle->features[kept] = bundle->features[i];
    before->features[kept] = before->features[i];
    (*ids)[kept++] = (*ids)[i];
  }
  bundle->features.resize(kept);
  before->features.resize(kept);
  ids->resize(kept);
  for (auto& observations : bundle->observations) {
    std::vector<BundleObservation> remaining;
    for (const BundleObservation& o : observations)
      if (place[o.feature] >= 0) {
        remaining.push_back(o);
        remaining.back().feature = place[o.feature];
      }
    observations.swap(remaining);
  }
}

/// Image points are as noisy, in that of most images, as what those of their image miss shows: of
/// one that is blurred all are worse (variance components; Foerstner 1979). The first image, from
/// which all is told, counts as most do.
void weighImages(const CameraModel& model, Bundle* bundle) {
  const double most_px = kMostMiss * medianOf(featureErrors(model, *bundle));
  const std::vector<double> errors_px = imageErrors(model, *bundle, most_px);
  const double median_px = medianOf({errors_px.begin() + 1, errors_px.end()});
  if (!(median_px > 0.0)) return;
  for (std::size_t k = 1; k < errors_px.size(); ++k) {
    auto& observations = bundle->observations[k];
    const double points = static_cast<double>(observations.size());
    const double squares = points * std::pow(errors_px[k] / median_px, 2);
    const double noise = std::sqrt((kPointsLikeOthers + squares) / (kPointsLikeOthers + points));
    for (BundleObservation& o : observations) o.noise *= noise;
  }
}

}  // namespace

BundleOptions startOptions(const FilterOptions& filter) {
  BundleOptions options;
  options.outlier_px = kOutlierSigmas * filter.sigma_px;
  options.sigma_px = filter.sigma_px;
  options.scale_by_scatter = true;
  options.inverse_depth = filter.initial_inverse_depth;
  options.sigma_inverse_depth = filter.initial_sigma_inverse_depth;
  options.minimum_inverse_depth = filter.minimum_inverse_depth;
  // So few images would bend the lens until depths fit their prior: it stays as calibrated.
  options.sigma_calibration[0] = filter.initial_sigma_readout_s;
  return options;
}

BundleOptions withDepthsOf(const Bundle& reading, BundleOptions options) {
  options.sigma_inverse_depth = std::max(
      options.sigma_inverse_depth, kDepthSpread * medianDeviation(reading, options.inverse_depth));
  return options;
}

void adjustByItsNoise(const CameraModel& model, BundleOptions* options, Bundle* reading,
                      Bundle* believed, std::vector<FeatureId>* ids) {
  weighImages(model, reading);
  const double noise_px = noiseOf(model, *reading);
  // Corners where something near hides something far wander by less than would make them outliers;
  // most image points are much better than that.
  options->outlier_px =
      std::clamp(kOutlierSigmas * noise_px, kLeastOutlierPx, kOutlierSigmas * options->sigma_px);
  options->sigma_px = std::min(options->sigma_px, std::max(noise_px, kLeastNoisePx));
  adjustBundle(model, *options, reading);
  dropWanderers(model, options->outlier_px, reading, believed, ids);
}

double depthFactor(const Eigen::VectorXd& unit_shares, const Bundle& before, const Bundle& bundle) {
  double logarithm = 0.0;
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    logarithm += unit_shares[static_cast<Eigen::Index>(i)] *
                 std::log(bundle.features[i].inverse_depth / before.features[i].inverse_depth);
  return std::exp(logarithm);
}

double medianDepthFactor(const Bundle& before, const Bundle& bundle) {
  std::vector<double> factors;
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    factors.push_back(bundle.features[i].inverse_depth / before.features[i].inverse_depth);
  return medianOf(std::move(factors));
}

}  // namespace active_matching_slam
