#pragma once

#include <memory>
#include <string>
#include <vector>

#include "active_matching_slam/matching/feature_search.h"
#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/match_result.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// Decides which image point belongs to which feature. Implementations keep scratch memory between
/// frames but no state that changes a result: the same input gives the same output, bit for bit.
class Matcher {
 public:
  virtual ~Matcher() = default;

  /// The name by which createMatcher() makes it.
  virtual std::string name() const = 0;

  /// `prior.size()` may be 0. `search` must be fresh (nothing searched) and speak of the same
  /// features. Degenerate priors (singular or non-finite blocks of S) never throw: features at
  /// fault are left unmatched and counted in the statistics.
  virtual MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                            const MatchOptions& options) = 0;
};

/// `name`: active_search, jcbb, one_point_ransac, active, fast_active, chow_liu, or auto (active
/// while its modelled cost fits the budget, chow_liu beyond where that costs half). Throws
/// std::invalid_argument that lists these for any other name.
std::unique_ptr<Matcher> createMatcher(const std::string& name);
const std::vector<std::string>& matcherNames();

}  // namespace active_matching_slam
