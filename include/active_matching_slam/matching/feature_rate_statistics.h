#pragma once

#include <cstdint>

#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// Beta priors of a feature's detection rates: means, and strengths in pseudo-observations.
struct FeatureRatePrior {
  FeatureRates mean;
  double searches = 10.0;   ///< strength of the prior of true_positive [searches]
  double pixels = 20000.0;  ///< strength of the prior of false_positive [pixels]
};

/// Detection statistics of a feature so far (Chli 2009, sections 5.3.3 and 5.4.1). A plain value:
/// it can be stored with the feature.
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
