#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/simulated_problem.h"
#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/match_result.h"

namespace active_matching_slam {

/// Whether what the accepted hypothesis claims is true: its matches are the features, and features
/// without a match did not answer in the ellipses that it and its ancestors searched. `result` must
/// come from `problem` through `search`, with its trace.
bool claimIsTrue(const SimulatedProblem& problem, const PointListSearch& search,
                 const MatchResult& result);

/// How often frames accepted with about the same weight were right.
struct ReliabilityBin {
  int frames = 0;
  double mean_weight = 0.0;
  double fraction_correct = 0.0;
  /// Standard deviation of fraction_correct if the weights are probabilities.
  double sigma = 0.0;
};

/// The reliability diagram of a matcher: weights against the fractions of frames that were correct.
class Reliability {
 public:
  explicit Reliability(int bins) : counts_(static_cast<std::size_t>(bins)) {}

  /// `weight` in [0, 1].
  void add(double weight, bool right);
  /// Bins of equal width, from weight 0 to 1.
  std::vector<ReliabilityBin> bins() const;

 private:
  struct Count {
    int frames = 0, right = 0;
    double weight = 0.0, variance = 0.0;
  };
  std::vector<Count> counts_;
};

/// Frames of four kinds in turn, with little clutter, with much, with very much, and at half the
/// frame rate, through a mixture matcher. Deterministic in `seed`.
Reliability measureReliability(const std::string& matcher, int frames, int bins, std::uint64_t seed,
                               MatchOptions options = {});

}  // namespace active_matching_slam
