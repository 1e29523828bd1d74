#pragma once

#include <vector>

#include "budgeted_search.h"
#include "joint.h"
#include "measurement_choice.h"
#include "mixture.h"

namespace active_matching_slam {

/// One frame of Active Matching on a joint Gaussian: choose, search, update, until a stop rule
/// fires or nothing is left.
class MixtureRun {
 public:
  enum class Policy { kFull, kFast };

  /// `given` is the prior as handed in, `prior` its proper part, `gaussians` what represents it:
  /// one, or its wide one besides; they must outlive the run.
  MixtureRun(const MeasurementPrior& given, const ProperPrior& prior,
             const std::vector<PriorGaussian>& gaussians, BudgetedSearch& budgeted, const MatchOptions& options, Policy policy);

  /// Runs, and fills the result (but for what BudgetedSearch::finish writes).
  void run(MatchResult& result);

 private:
  /// Seconds spent on choosing.
  double searchToEnd(MatchResult& result);
  /// The next search, none when done. Sets the latch.
  Measurement choose();
  Measurement chooseAfterLatch();
  void latch();
  bool isFinished() const;
  void acceptNearest(MatchResult& result);
  bool agrees(const Explanation& e, int feature, int match) const;
  MatchStep begin(const Measurement& measurement) const;
  void record(MatchStep step, MatchResult& result) const;
  void report(MatchResult& result) const;
  std::vector<int> matchesOf(const Explanation& e) const;

  const ProperPrior& prior_;
  BudgetedSearch& search_;
  const MatchOptions& options_;
  Policy policy_;
  Mixture mixture_;
  MeasurementChoice choice_;
  std::mt19937_64 random_;
  bool latched_ = false;
};

}  // namespace active_matching_slam
