#include "active_matching_slam/matching/feature_rate_statistics.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace active_matching_slam {
namespace {

void requireBetween(const char* name, double value, double low, double high, const char* range) {
  if (value > low && value < high) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + ", must be in " +
                              range);
}

}  // namespace

void FeatureRateStatistics::add(bool found, std::int64_t matches, std::int64_t pixels_searched) {
  ++(found ? successes : failures);
  spurious += std::max<std::int64_t>(matches - (found ? 1 : 0), 0);
  pixels += pixels_searched;
}

FeatureRates FeatureRateStatistics::rates(const FeatureRatePrior& prior) const {
  requireBetween("mean.true_positive", prior.mean.true_positive, 0.0, 1.0, "(0, 1)");
  requireBetween("mean.false_positive", prior.mean.false_positive, 0.0, 1.0, "(0, 1)");
  requireBetween("searches", prior.searches, 0.0, 1e300, "(0, inf)");
  requireBetween("pixels", prior.pixels, 0.0, 1e300, "(0, inf)");
  const auto posterior = [](double hits, double trials, double mean, double strength) {
    return (mean * strength + hits) / (strength + trials);
  };
  FeatureRates rates;
  rates.true_positive =
      posterior(static_cast<double>(successes), static_cast<double>(successes + failures),
                prior.mean.true_positive, prior.searches);
  // A pixel gives at most one false positive, whatever was counted.
  const double trials = static_cast<double>(std::max(pixels, spurious));
  rates.false_positive =
      posterior(static_cast<double>(spurious), trials, prior.mean.false_positive, prior.pixels);
  return rates;
}

}  // namespace active_matching_slam
