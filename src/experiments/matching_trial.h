#pragma once

#include <string>
#include <vector>

#include "active_matching_slam/experiments/table.h"
#include "active_matching_slam/matching/matcher.h"
#include "recording.h"

namespace active_matching_slam {

/// A matcher with settings of its own, under a label.
struct MatcherVariant {
  std::string label;
  std::string matcher;
  MatchOptions options;
};

/// The six matchers as the thesis has them - its rule for the weights, uniform rates, no stop rule
/// - and `active_live` and `chow_liu_live` with the package's defaults.
const std::vector<MatcherVariant>& matcherVariants();
const MatcherVariant& matcherVariant(const std::string& label);

/// These features (indices) of a problem. What is left out of a joint Gaussian is marginalised, so
/// the rest keep their means and covariances.
RecordedProblem selectFeatures(const RecordedProblem& problem, const std::vector<int>& kept);
/// So many of them, evenly spread; all when there are not so many.
RecordedProblem spreadFeatures(const RecordedProblem& problem, int features);

/// What a matcher made of one problem.
struct MatchingTrial {
  MatchResult result;
  std::vector<Eigen::Vector2d> accepted_px;  ///< one a feature; NaN: none
  int spurious = 0;              ///< matches met beyond one a feature accepted: what confuses
  int right = 0, wrong = 0;      ///< accepted, and within / beyond 3 px of a known reference
  int missed = 0;                ///< not accepted though the reference is inside the search area
  std::vector<double> error_px;  ///< of each accepted with a known reference
  std::vector<std::vector<SearchMatch>> matches;  ///< all that were met of each, with a trace
};

MatchingTrial tryMatcher(const Sequence& sequence, const RecordedProblem& problem,
                         const MatcherVariant& variant, bool keep_trace = false);

/// Means over the frames of one cell of the test-bed.
struct TrialSummary {
  int frames = 0;
  double candidates = 0.0, matched = 0.0, pixels = 0.0, gate_pixels = 0.0, spurious = 0.0;
  double right = 0.0, wrong = 0.0, missed = 0.0;  ///< a frame
  double error_px = 0.0;                          ///< mean over the accepted; NaN without any
  int most_gaussians = 0;
  double mean_most_gaussians = 0.0, steps = 0.0;
  int cut_short = 0;     ///< frames
  int same_as_jcbb = 0;  ///< frames with the same associations
  double information_ms = 0.0, correlation_ms = 0.0, update_ms = 0.0, tree_ms = 0.0;
  double total_ms = 0.0, other_ms = 0.0;
};

/// Means of trials of the same problems; `jcbb` are JCBB's of them.
TrialSummary summariseTrials(const std::vector<MatchingTrial>& trials,
                             const std::vector<MatchingTrial>& jcbb,
                             const std::vector<RecordedProblem>& problems);

/// Every feature with the same match, or the same lack of one.
bool sameAssociations(const MatchingTrial& a, const MatchingTrial& b);

}  // namespace active_matching_slam
