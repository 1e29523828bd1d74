#pragma once

#include <functional>

#include "active_matching_slam/matching/feature_search.h"
#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/match_result.h"
#include "proper_prior.h"

namespace active_matching_slam {

/// The feature search of a frame, indexed by the proper features of its prior, that accounts for
/// its cost against the budgets of the options.
class BudgetedSearch {
 public:
  BudgetedSearch(const ProperPrior& prior, FeatureSearch& search, const MatchOptions& options);

  /// Searches the feature (index in the proper prior).
  SearchOutcome search(int feature, const SearchEllipse& ellipse);
  const std::vector<SearchMatch>& matches(int feature) const {
    return search_.matches(prior_.original(feature));
  }
  const PixelMask& searchedPixels(int feature) const {
    return search_.searchedPixels(prior_.original(feature));
  }
  double expectedCost(int feature, double area_px) const {
    return search_.expectedCost(prior_.original(feature), area_px);
  }
  PixelBox validArea(int feature) const { return search_.validArea(prior_.original(feature)); }

  /// Seconds of the options' clock, or of a steady clock.
  double now() const { return clock_s_(); }
  double correlationSeconds() const { return correlation_s_; }
  double elapsedMilliseconds() const { return 1e3 * (now() - start_s_); }
  /// Adds to the modelled time.
  void charge(double milliseconds) { modelled_ms_ += milliseconds; }
  /// Time that counts against the budget.
  double spentMilliseconds() const {
    return options_.modelled_time ? modelled_ms_ : elapsedMilliseconds();
  }
  std::int64_t pixelsSearched() const { return pixels_; }
  /// Fraction used up of the tightest of the options' budgets.
  double fractionUsed() const;
  bool isOverBudget() const { return fractionUsed() >= 1.0; }

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
