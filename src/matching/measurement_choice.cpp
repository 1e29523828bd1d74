#include "measurement_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace active_matching_slam {
namespace {

constexpr double kLog2E = 1.44269504088896340736;

std::size_t slot(int i) { return static_cast<std::size_t>(i); }

}  // namespace

void MeasurementChoice::updateEntropy() {
  log_weights_.clear();
  double entropy = 0.0;
  for (const Hypothesis& h : mixture_.hypotheses()) {
    log_weights_.push_back(std::log(std::max(h.weight, 1e-300)));
    entropy -= h.weight * log_weights_.back();
  }
  entropy_ = entropy * kLog2E;
}

/// (eq. 5.13-5.18) with the likelihoods divided by that of clutter alone. The entropy of weights
/// w_k = lambda_k t_k is ln W - sum_k lambda_k (t_k ln lambda_k + t_k ln t_k) / W.
ExpectedInformation MeasurementChoice::evaluate(int g, int c) {
  const std::vector<Hypothesis>& all = mixture_.hypotheses();
  const Hypothesis& searcher = all[slot(g)];
  const Hypothesis::Candidate& gate = searcher.candidates[slot(c)];
  double null_sum = 0.0, null_log = 0.0, match_sum = 0.0, match_log = 0.0;
  for (int k = 0; k < static_cast<int>(all.size()); ++k) {
    const PairTerm& term = mixture_.term(k, c, g);
    const double weight = all[slot(k)].weight, log_weight = log_weights_[slot(k)];
    null_sum += weight * term.null;
    null_log += weight * (term.null * log_weight + term.null_log);
    match_sum += weight * term.match;
    match_log += weight * (term.match * log_weight + term.match_log);
  }
  const double child = searcher.weight * gate.child;
  match_sum += child;
  match_log += searcher.weight * (gate.child * log_weights_[slot(g)] + gate.child_log);
  ExpectedInformation expected;
  expected.null_probability =
      null_sum / (null_sum + mixture_.likelihood(gate.feature).clutter_odds * match_sum);
  const double after_null = (std::log(null_sum) - null_log / null_sum) * kLog2E;
  const double after_match = (std::log(match_sum) - match_log / match_sum) * kLog2E;
  expected.discrete_bits = entropy_ - expected.null_probability * after_null -
                           (1.0 - expected.null_probability) * after_match;
  expected.continuous_bits =
      child / match_sum * searcher.joint->marginal(gate.feature).information_bits;
  expected.score = expected.bits() / gate.area;
  return expected;
}

double MeasurementChoice::bound(const Hypothesis& h, const Hypothesis::Candidate& gate) const {
  const SearchLikelihood& likelihood = mixture_.likelihood(gate.feature);
  const double child = h.weight * gate.child;
  // The other weights after a match are linear in their masses: least at 0 or at 1.
  const double missed = likelihood.in * (gate.area - 1.0);
  const double own = h.weight * (missed * gate.mass + gate.area * (1.0 - gate.mass));
  const double others = (1.0 - h.weight) * std::min(gate.area, likelihood.match + missed);
  const double share = child / (child + std::max(own, 0.0) + std::max(others, 0.0));
  const double bits = entropy_ + share * h.joint->marginal(gate.feature).information_bits;
  return bits / gate.area * (1.0 + 1e-9);
}

ExpectedInformation MeasurementChoice::takeIfBetter(int g, int c, Measurement& best) {
  const ExpectedInformation expected = evaluate(g, c);
  const bool better = !best.exists() || expected.score > best.expected.score ||
                      (expected.score == best.expected.score &&
                       std::make_pair(g, c) < std::make_pair(best.hypothesis, best.candidate));
  if (better) best = {g, c, expected};
  return expected;
}

Measurement MeasurementChoice::best() {
  updateEntropy();
  bounds_.clear();
  const int count = static_cast<int>(mixture_.hypotheses().size());
  std::size_t most_promising = 0;
  for (int g = 0; g < count; ++g) {
    const Hypothesis& h = mixture_.hypotheses()[slot(g)];
    for (std::size_t c = 0; c < h.candidates.size(); ++c) {
      if (!h.candidates[c].open) continue;
      bounds_.push_back({bound(h, h.candidates[c]), g, static_cast<int>(c)});
      if (bounds_.back().bound > bounds_[most_promising].bound) most_promising = bounds_.size() - 1;
    }
  }
  // A good one first, so that the bound can spare most of the others.
  Measurement best;
  const auto consider = [&](const Bounded& b) {
    if (best.exists() && b.bound < best.expected.score) return;
    if (isCandidate(b.hypothesis, b.candidate)) takeIfBetter(b.hypothesis, b.candidate, best);
  };
  if (!bounds_.empty()) consider(bounds_[most_promising]);
  for (const Bounded& b : bounds_) consider(b);
  return best;
}

Measurement MeasurementChoice::bestOfDrawn(int count, std::mt19937_64& random, double& most_bits) {
  updateEntropy();
  const int hypotheses = static_cast<int>(mixture_.hypotheses().size());
  std::vector<std::vector<int>> open(slot(hypotheses));
  for (int g = 0; g < hypotheses; ++g) {
    const auto& candidates = mixture_.hypotheses()[slot(g)].candidates;
    for (std::size_t c = 0; c < candidates.size(); ++c)
      if (candidates[c].open) open[slot(g)].push_back(static_cast<int>(c));
  }
  Measurement best;
  most_bits = -std::numeric_limits<double>::infinity();
  // Rounds of one draw from each Gaussian that has candidates left.
  for (bool any = true; any && count > 0;) {
    any = false;
    for (int g = 0; g < hypotheses && count > 0; ++g) {
      std::vector<int>& left = open[slot(g)];
      while (!left.empty()) {
        const auto drawn = static_cast<std::size_t>(random() % left.size());
        const int c = left[drawn];
        left[drawn] = left.back();
        left.pop_back();
        if (!isCandidate(g, c)) continue;
        most_bits = std::max(most_bits, takeIfBetter(g, c, best).bits());
        --count;
        any = true;
        break;
      }
    }
  }
  return best;
}

Measurement MeasurementChoice::firstOf(int hypothesis) {
  const auto& candidates = mixture_.hypotheses()[slot(hypothesis)].candidates;
  for (int c = 0; c < static_cast<int>(candidates.size()); ++c)
    if (isCandidate(hypothesis, c)) return {hypothesis, c, {}};
  return {};
}

}  // namespace active_matching_slam
