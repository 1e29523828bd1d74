#include "budgeted_search.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "active_matching_slam/matching/search_ellipse.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

double steadySeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

BudgetedSearch::BudgetedSearch(const ProperPrior& prior, FeatureSearch& search,
                               const MatchOptions& options)
    : prior_(prior),
      search_(search),
      options_(options),
      clock_s_(options.clock_s ? options.clock_s : steadySeconds),
      start_s_(clock_s_()) {}

SearchOutcome BudgetedSearch::search(int feature, const SearchEllipse& ellipse) {
  const double start = now();
  SearchOutcome outcome = search_.search(prior_.original(feature), ellipse);
  correlation_s_ += now() - start;
  ++searches_;
  pixels_ += outcome.correlations;
  const double rows = 2.0 * std::sqrt(kEllipseRadius2 * std::max(ellipse.covariance(1, 1), 0.0));
  const PixelBox valid = validArea(feature);
  const double most = valid.isUnbounded() ? rows : valid.max_v - valid.min_v + 1.0;
  charge(modelledSearch_ms(static_cast<double>(outcome.correlations)) +
         kEllipseRowMs * std::max(std::min(rows, most), 0.0) +
         kMatchMs * static_cast<double>(outcome.matches.size()));
  return outcome;
}

double BudgetedSearch::fractionUsed() const {
  // On a busy machine the time would end after a few searches, nothing would match, and the gates
  // and the time for the next frame would grow. The clock is read only if it counts.
  const bool counts = options_.max_milliseconds > 0.0 && searches_ >= kFloorSearches;
  return fractionOfBudget(options_, pixels_, counts ? spentMilliseconds() : 0.0);
}

MatchResult BudgetedSearch::begin(const char* matcher) const {
  MatchResult result;
  const int total = prior_.size() + prior_.leftOut();
  result.match_of_feature.assign(static_cast<std::size_t>(total), -1);
  result.statistics.matcher = matcher;
  result.statistics.candidates = total;
  result.statistics.degenerate_features = prior_.leftOut();
  for (int f = 0; f < prior_.size(); ++f)
    result.statistics.pixels_full_gates +=
        countEllipsePixels({prior_.mean(f), prior_.covariance(f)}, validArea(f));
  return result;
}

void BudgetedSearch::finish(MatchResult& result) const {
  MatchStatistics& s = result.statistics;
  s.matched = 0;
  for (const int match : result.match_of_feature) s.matched += match >= 0;
  s.searches = searches_;
  s.pixels_searched = pixels_;
  s.matches_met = 0;
  for (int f = 0; f < prior_.size(); ++f) s.matches_met += static_cast<int>(matches(f).size());
  s.correlation_ms = 1e3 * correlation_s_;
  s.total_ms = elapsedMilliseconds();
  s.budget_ms = spentMilliseconds();
  if (result.hypotheses.empty() && !result.match_of_feature.empty())
    result.hypotheses.push_back({0, -1, 1.0, result.match_of_feature});
}

}  // namespace active_matching_slam
