#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// A surviving explanation of the frame.
struct MatchHypothesis {
  int gaussian = -1;  ///< id in the trace; parent as there
  int parent = -1;
  /// Posterior by joint re-scoring; without it, the weight in the mixture.
  double probability = 0.0;
  std::vector<int> match_of_feature;  ///< F: index into FeatureSearch::matches(feature), or -1
};

/// What one step of a mixture matcher did: the search of one feature in one Gaussian.
struct MatchStep {
  struct GaussianWeight {
    int gaussian = -1;
    int parent = -1;
    double weight = 0.0;
  };
  int feature = -1;
  int gaussian = -1;
  SearchEllipse ellipse;
  double area_px = 0.0;   ///< of the ellipse, clipped to the valid area
  bool evaluated = true;  ///< false after a latch: no MI was computed, the next fields are zero
  double discrete_information_bits = 0.0;
  double continuous_information_bits = 0.0;
  double mutual_information_bits = 0.0;  ///< I(z_f; rest) in this Gaussian
  double score = 0.0;                    ///< (discrete + continuous) / expected cost
  double null_probability = 0.0;         ///< predicted probability of no match
  int pixels_in_ellipse = 0;
  int pixels_new = 0;
  std::vector<int> matches;             ///< indices into FeatureSearch::matches(feature)
  std::vector<int> spawned;             ///< those of `matches` that got a child
  std::vector<GaussianWeight> weights;  ///< after the update, before pruning
  std::vector<GaussianWeight> pruned;   ///< after pruning and renormalising
};

struct MatchStatistics {
  std::string matcher;  ///< which one ran (for auto: the one it chose)
  int candidates = 0;   ///< F
  int matched = 0;
  int searches = 0;
  std::int64_t pixels_searched = 0;     ///< correlations, summed over features: their cost
  std::int64_t pixels_full_gates = 0;   ///< pixels of the prior's 3-sigma ellipses, summed
  int matches_met = 0;                  ///< distinct (feature, match) found
  int max_gaussians = 0;                ///< most live at once, before pruning
  double information_bits_start = 0.0;  ///< sum over features of I(z_i; rest) in the prior
  double information_bits_end = 0.0;    ///< what the accepted hypothesis left unmeasured
  double accepted_weight = 1.0;      ///< probability of the accepted hypothesis (1 for baselines)
  double dropped_probability = 0.0;  ///< of the hypotheses that the result does not list
  bool ambiguous = false;            ///< accepted_weight below options.ambiguous_below_weight
  bool cut_short = false;            ///< a budget or a cap ended the search early
  int degenerate_features = 0;  ///< left out because their prediction was not a proper Gaussian
  std::int64_t nodes = 0;       ///< jcbb: nodes visited; one_point_ransac: hypotheses
  int inliers = 0;            ///< one_point_ransac: low-innovation inliers, the hypothesis included
  double mahalanobis2 = 0.0;  ///< jcbb, one_point_ransac: joint squared distance of all pairings
  // Durations [ms]
  double information_ms = 0.0;
  double correlation_ms = 0.0;
  double mixture_ms = 0.0;
  double tree_ms = 0.0;
  double total_ms = 0.0;
  double budget_ms = 0.0;  ///< what counts against the budget: as total_ms, or modelled
};

/// The outcome of a frame. Match indices point into FeatureSearch::matches(feature).
struct MatchResult {
  std::vector<int> match_of_feature;  ///< F: accepted match, or -1. When ambiguous: only what all
                                      ///< strong hypotheses have in common; never one of merged
                                      ///< matches below merge_probability
  std::vector<MatchHypothesis> hypotheses;      ///< heaviest first; never empty when F > 0
  std::vector<std::pair<int, int>> tree_edges;  ///< chow_liu: (i, j), i < j; else empty
  bool is_wide = false;  ///< accepted: a hypothesis of the prior's wide Gaussian
  MatchStatistics statistics;
  std::vector<MatchStep> trace;  ///< empty unless options.keep_trace
};

}  // namespace active_matching_slam
