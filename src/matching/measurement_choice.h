#pragma once

#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "mixture.h"

namespace active_matching_slam {

/// Expected information of a search. (Chli 2009, eq. 5.11-5.18)
struct ExpectedInformation {
  double discrete_bits = 0.0;    ///< about which Gaussian is true; may be negative
  double continuous_bits = 0.0;  ///< about where the other features are
  double null_probability = 0.0;
  double score = 0.0;  ///< bits per correlation that the search will take
  double bits() const { return discrete_bits + continuous_bits; }
};

/// A search that could be made next: a candidate of a hypothesis (indices).
struct Measurement {
  int hypothesis = -1;
  int candidate = -1;
  ExpectedInformation expected;
  bool exists() const { return candidate >= 0; }
};

/// Chooses the next search of a mixture.
class MeasurementChoice {
 public:
  MeasurementChoice(Mixture& mixture, bool skip_exhausted)
      : mixture_(mixture), skip_exhausted_(skip_exhausted) {}

  /// The candidate of the highest score; ties: the lower Gaussian, then the lower feature.
  /// Candidates whose bound, (H(lambda) + most continuous information) / cost, is below the best
  /// are skipped.
  Measurement best();
  /// The best of `count` candidates drawn at random, evenly spread over the Gaussians; `most_bits`:
  /// the largest expected information among them.
  Measurement bestOfDrawn(int count, std::mt19937_64& random, double& most_bits);
  /// The candidate of one hypothesis with the most continuous information per pixel.
  Measurement bestOf(int hypothesis);
  /// The lowest candidate of one hypothesis, without any evaluation.
  Measurement firstOf(int hypothesis);

  ExpectedInformation evaluate(int g, int c);

 private:
  bool isCandidate(int g, int c) {
    return mixture_.hypotheses()[static_cast<std::size_t>(g)]
               .candidates[static_cast<std::size_t>(c)]
               .open &&
           !(skip_exhausted_ && mixture_.isExhausted(g, c));
  }
  /// Gaussians with the same marginal of a feature: their weights together.
  struct Group {
    int representative;
    int entry;
    int members;
    double weight;
    double weighted_log;  ///< sum of lambda ln(lambda)
  };

  void beginStep();
  const std::vector<Group>& groupsOf(int feature);
  double bound(const Hypothesis& h, const Hypothesis::Candidate& gate) const;
  ExpectedInformation takeIfBetter(int g, int c, Measurement& best);

  Mixture& mixture_;
  bool skip_exhausted_;
  double entropy_ = 0.0;             // H(lambda) [bits]
  std::vector<double> log_weights_;  // ln(lambda)
  struct FeatureGroups {
    std::int64_t step = -1;
    std::vector<Group> groups;
  };
  std::int64_t step_ = 0;
  std::vector<FeatureGroups> groups_;  // by feature
  std::vector<int> group_of_entry_;
};

}  // namespace active_matching_slam
