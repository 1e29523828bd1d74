#pragma once

#include "active_matching_slam/matching/matcher.h"
#include "proper_prior.h"

namespace active_matching_slam {

/// Active Matching with the full joint Gaussian. (Chli 2009, chapter 5)
class ActiveMatcher : public Matcher {
 public:
  std::string name() const override { return "active"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

/// Fast Active Matching: information of a few candidates drawn at random, and none at all once it
/// is small; then the nearest match to each prediction of a dominant Gaussian. (Chli 2009,
/// section 7.2)
class FastActiveMatcher : public Matcher {
 public:
  std::string name() const override { return "fast_active"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

/// Chow-Liu Active Matching: the joint is a tree. (Chli 2009, sections 7.3 and 7.4)
class ChowLiuMatcher : public Matcher {
 public:
  std::string name() const override { return "chow_liu"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;
};

/// `active` while its cost, modelled from the number of features and the matches to be expected,
/// fits the frame, `chow_liu` beyond.
class AutoMatcher : public Matcher {
 public:
  std::string name() const override { return "auto"; }
  MatchResult match(const MeasurementPrior& prior, FeatureSearch& search,
                    const MatchOptions& options) override;

 private:
  ActiveMatcher active_;
  ChowLiuMatcher chow_liu_;
};

}  // namespace active_matching_slam
