#pragma once

#include <functional>

#include "active_matching_slam/matching/feature_search.h"
#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/match_result.h"
#include "proper_prior.h"

namespace active_matching_slam {

/// The search of a frame seen through the proper features of its prior, with its costs written
/// down.
class SearchLedger {
 public:
  SearchLedger(const ProperPrior& prior, FeatureSearch& search, const MatchOptions& options);

  /// Searches the feature (index in the proper prior).
  SearchOutcome search(int feature, const SearchEllipse& ellipse);
  const std::vector<SearchMatch>& matches(int feature) const {
    return search_.matches(prior_.original(feature));
  }
  const PixelMask& searchedPixels(int feature) const {
    return search_.searchedPixels(prior_.original(feature));
  }
  PixelBox validArea(int feature) const { return search_.validArea(prior_.original(feature)); }

  /// Seconds of the options' clock, or of a steady clock.
  double now() const { return clock_s_(); }
  double correlationSeconds() const { return correlation_s_; }
  double elapsedMilliseconds() const { return 1e3 * (now() - start_s_); }
  /// Adds to the modelled time.
  void charge(double milliseconds) { modelled_ms_ += milliseconds; }
  /// What counts against the budget of time.
  double spentMilliseconds() const {
    return options_.modelled_time ? modelled_ms_ : elapsedMilliseconds();
  }
  std::int64_t pixelsSearched() const { return pixels_; }
  /// Share used up of the options' budgets, of the tightest.
  double budgetUsed() const;
  bool isOverBudget() const { return budgetUsed() >= 1.0; }

  /// Starts a result: sizes, name, candidates, full gates.
  MatchResult begin(const char* matcher) const;
  /// Writes the costs and the number of matched features into its statistics.
  void finish(MatchResult& result) const;

 private:
  const ProperPrior& prior_;
  FeatureSearch& search_;
  const MatchOptions& options_;
  std::function<double()> clock_s_;
  double start_s_;
  double correlation_s_ = 0.0;
  double modelled_ms_ = 0.0;
  int searches_ = 0;
  std::int64_t pixels_ = 0;
};

}  // namespace active_matching_slam
