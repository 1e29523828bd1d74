#pragma once

#include <cstdint>

#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// What is believed of a feature's rates before it was ever searched, and how firmly.
struct FeatureRatePrior {
  FeatureRates mean;
  double searches = 10.0;   ///< the belief in true_positive counts as much as this many searches
  double pixels = 20000.0;  ///< the belief in false_positive counts as much as this many pixels
};

/// How often a feature's searches told the truth so far (Chli 2009, sections 5.3.3 and 5.4.1). A
/// plain value: it can be stored with the feature.
struct FeatureRateStatistics {
  std::int64_t successes = 0;  ///< matched at the accepted place
  std::int64_t failures = 0;   ///< searched at the accepted place without a match
  std::int64_t spurious = 0;   ///< matches elsewhere
  std::int64_t pixels = 0;     ///< searched

  /// A frame in which the feature was searched. `found`: its match was accepted; `matches`: all
  /// that were met, the accepted one included; `pixels_searched`: distinct ones.
  void add(bool found, std::int64_t matches, std::int64_t pixels_searched);

  /// Posterior means under Beta priors; always inside (0, 1). Throws std::invalid_argument when the
  /// prior's rates are not inside (0, 1) or its strengths are not positive.
  FeatureRates rates(const FeatureRatePrior& prior) const;
};

}  // namespace active_matching_slam
