#include "baseline_matchers.h"
#include "gate_search.h"

namespace active_matching_slam {

MatchResult ActiveSearchMatcher::match(const MeasurementPrior& given, FeatureSearch& search,
                                       const MatchOptions& options) {
  const ProperPrior prior(given);
  SearchLedger ledger(prior, search, options);
  MatchResult result = ledger.begin("active_search");
  const auto gates = searchFullGates(prior, ledger, &result.statistics.cut_short);
  for (int f = 0; f < prior.size(); ++f)
    result.match_of_feature[static_cast<std::size_t>(prior.original(f))] =
        bestScore(ledger.matches(f), gates[static_cast<std::size_t>(f)]);
  ledger.finish(result);
  return result;
}

}  // namespace active_matching_slam
