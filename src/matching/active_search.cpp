#include "baseline_matchers.h"
#include "gate_search.h"

namespace active_matching_slam {

MatchResult ActiveSearchMatcher::match(const MeasurementPrior& given, FeatureSearch& search,
                                       const MatchOptions& options) {
  const ProperPrior prior(given);
  BudgetedSearch budgeted(prior, search, options);
  MatchResult result = budgeted.begin("active_search");
  const auto gates = searchFullGates(prior, budgeted, &result.statistics.cut_short);
  for (int f = 0; f < prior.size(); ++f)
    result.match_of_feature[static_cast<std::size_t>(prior.original(f))] =
        bestScore(budgeted.matches(f), gates[static_cast<std::size_t>(f)]);
  budgeted.finish(result);
  return result;
}

}  // namespace active_matching_slam
