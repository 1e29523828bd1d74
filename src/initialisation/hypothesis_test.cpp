#include "hypothesis_test.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/math/chi_square.h"
#include "motion_candidates.h"

namespace active_matching_slam {
namespace {

/// Cost: iterations by the noise assumed, which find the minimum, and its noise.
constexpr int kFirstIterations = 6;

double imagePoints(const Bundle& bundle) {
  std::size_t points = 0;
  for (const auto& observations : bundle.observations) points += observations.size();
  return static_cast<double>(points);
}

/// Whether the translation is more than what noise would gain by its parameters.
bool isTranslationSignificant(const InitialiserOptions& options, const Bundle& bundle,
                              double cost_decrease) {
  const std::size_t parameters = 3 * (bundle.cameras.size() - 1) + bundle.features.size();
  const double quantile =
      chiSquareQuantile(static_cast<double>(parameters), 1.0 - std::exp(-options.log_odds));
  return cost_decrease > options.correlation_inflation * quantile;
}

}  // namespace

double logOdds(double cost, double other_cost, double correlation_inflation) {
  return 0.5 * (other_cost - cost) / correlation_inflation;
}

std::optional<MotionTest> testMotions(const CameraModel& model, const InitialiserOptions& options,
                                      const BundleOptions& bundle_options,
                                      const Bundle& rotation_only) {
  BundleOptions by_noise = bundle_options;
  by_noise.max_iterations = kFirstIterations;
  std::vector<Bundle> candidates = motionCandidates(model, bundle_options, rotation_only);
  std::vector<double> costs;
  const auto adjustAll = [&] {
    costs.clear();
    for (Bundle& candidate : candidates)
      costs.push_back(adjustBundle(model, by_noise, &candidate).cost);
    return std::min_element(costs.begin(), costs.end()) - costs.begin();
  };
  if (candidates.empty()) return std::nullopt;
  auto best = adjustAll();
  if (costs[best] > 2.0 * options.maximum_reduced_chi2 * imagePoints(candidates[best]))
    return std::nullopt;
  // Images are often much better than assumed: the candidates are compared by the noise that the
  // best shows, by which one wrong match does not weigh as much as all that are right.
  by_noise = bundle_options;
  by_noise.sigma_px = std::clamp(estimateSigma(model, candidates[best]),
                                 bundle_options.minimum_sigma_px, bundle_options.sigma_px);
  best = adjustAll();

  double log_odds = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (!isSameMotion(candidates[i], candidates[best]))
      log_odds = std::min(log_odds, logOdds(costs[best], costs[i], options.correlation_inflation));
  if (log_odds < options.log_odds) return std::nullopt;
  Bundle rotated = rotation_only;
  by_noise.rotation_only = true;
  const double rotated_cost = adjustBundle(model, by_noise, &rotated).cost;
  if (!isTranslationSignificant(options, rotated, rotated_cost - costs[best])) return std::nullopt;
  return MotionTest{std::move(candidates[best]), by_noise.sigma_px, log_odds};
}

}  // namespace active_matching_slam
