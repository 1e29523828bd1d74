#include "measurement_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/math/slot.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

constexpr double kLog2E = 1.44269504088896340736;

}  // namespace

void MeasurementChoice::beginStep() {
  ++step_;
  groups_.resize(slot(mixture_.features()));
  log_weights_.clear();
  double entropy = 0.0;
  for (const Hypothesis& h : mixture_.hypotheses()) {
    log_weights_.push_back(std::log(std::max(h.weight, 1e-300)));
    entropy -= h.weight * log_weights_.back();
  }
  entropy_ = entropy * kLog2E;
}

const std::vector<MeasurementChoice::Group>& MeasurementChoice::groupsOf(int feature) {
  FeatureGroups& known = groups_[slot(feature)];
  if (known.step == step_) return known.groups;
  known.step = step_;
  known.groups.clear();
  group_of_entry_.assign(PairTable::kMost, -1);
  const std::vector<Hypothesis>& all = mixture_.hypotheses();
  for (int k = 0; k < static_cast<int>(all.size()); ++k) {
    const int entry = all[slot(k)].entry[slot(feature)];
    const double weight = all[slot(k)].weight, weighted_log = weight * log_weights_[slot(k)];
    int* group = entry == PairTable::kNone ? nullptr : &group_of_entry_[slot(entry)];
    if (group && *group >= 0) {
      Group& joined = known.groups[slot(*group)];
      ++joined.members;
      joined.weight += weight;
      joined.weighted_log += weighted_log;
      continue;
    }
    if (group) *group = static_cast<int>(known.groups.size());
    known.groups.push_back({k, entry, 1, weight, weighted_log});
  }
  return known.groups;
}

/// (eq. 5.13-5.18) with the likelihoods divided by that of clutter alone. The entropy of weights
/// w_k = lambda_k t_k is ln W - sum_k lambda_k (t_k ln lambda_k + t_k ln t_k) / W.
ExpectedInformation MeasurementChoice::evaluate(int g, int c) {
  const Hypothesis& searcher = mixture_.hypotheses()[slot(g)];
  const Hypothesis::Candidate& gate = searcher.candidates[slot(c)];
  const int own_entry = searcher.entry[slot(gate.feature)];
  const double own_weight = searcher.weight, own_weighted_log = own_weight * log_weights_[slot(g)];
  double null_sum = 0.0, null_log = 0.0, match_sum = 0.0, match_log = 0.0;
  const auto add = [&](const PairTerm& term, double weight, double weighted_log) {
    null_sum += weight * term.null;
    null_log += weighted_log * term.null + weight * term.null_log;
    match_sum += weight * term.match;
    match_log += weighted_log * term.match + weight * term.match_log;
  };
  const std::vector<Group>& groups = groupsOf(gate.feature);
  mixture_.charge(kTermMs * static_cast<double>(groups.size()));
  for (const Group& group : groups) {
    const bool is_own =
        own_entry == PairTable::kNone ? group.representative == g : group.entry == own_entry;
    if (!is_own) {
      add(mixture_.term(group.representative, c, g), group.weight, group.weighted_log);
    } else if (group.members > 1) {
      add(mixture_.term(group.representative, c, g), group.weight - own_weight,
          group.weighted_log - own_weighted_log);
    }
  }
  add(mixture_.ownTerm(g, c), own_weight, own_weighted_log);
  const double child = own_weight * gate.child;
  match_sum += child;
  match_log += own_weighted_log * gate.child + own_weight * gate.child_log;
  ExpectedInformation expected;
  expected.null_probability =
      null_sum / (null_sum + mixture_.likelihood(gate.feature).clutter_odds * match_sum);
  const double after_null = (std::log(null_sum) - null_log / null_sum) * kLog2E;
  const double after_match = (std::log(match_sum) - match_log / match_sum) * kLog2E;
  expected.discrete_bits = entropy_ - expected.null_probability * after_null -
                           (1.0 - expected.null_probability) * after_match;
  expected.continuous_bits = child / match_sum * gate.bits;
  expected.score = expected.bits() / gate.cost;
  return expected;
}

double MeasurementChoice::bound(const Hypothesis& h, const Hypothesis::Candidate& gate) const {
  const SearchLikelihood& likelihood = mixture_.likelihood(gate.feature);
  const double child = h.weight * gate.child;
  // The other weights after a match are linear in their masses: least at 0 or at 1.
  const double missed = likelihood.in * (gate.area - 1.0);
  const double own = h.weight * (missed * gate.mass + gate.area * (1.0 - gate.mass));
  const double others = (1.0 - h.weight) * std::min(gate.area, likelihood.match + missed);
  const double probability = child / (child + std::max(own, 0.0) + std::max(others, 0.0));
  const double bits = entropy_ + probability * gate.bits;
  return bits / gate.cost * (1.0 + 1e-9);
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
  beginStep();
  const auto& all = mixture_.hypotheses();
  // A promising one first, so that the bound can spare most of the others.
  Measurement best, promising;
  double most = -1.0;
  for (int g = 0; g < static_cast<int>(all.size()); ++g) {
    const auto& candidates = all[slot(g)].candidates;
    for (int c = 0; c < static_cast<int>(candidates.size()); ++c) {
      const Hypothesis::Candidate& gate = candidates[slot(c)];
      if (!gate.open || !(entropy_ + gate.bits > most * gate.cost)) continue;
      most = (entropy_ + gate.bits) / gate.cost;
      promising = {g, c, {}};
    }
  }
  const auto consider = [&](int g, int c) {
    if (isCandidate(g, c)) takeIfBetter(g, c, best);
  };
  if (promising.exists()) consider(promising.hypothesis, promising.candidate);
  for (int g = 0; g < static_cast<int>(all.size()); ++g) {
    const Hypothesis& h = all[slot(g)];
    mixture_.charge(kLookMs * static_cast<double>(h.candidates.size()));
    for (int c = 0; c < static_cast<int>(h.candidates.size()); ++c) {
      const Hypothesis::Candidate& gate = h.candidates[slot(c)];
      if (!gate.open) continue;
      const double score = best.exists() ? best.expected.score : 0.0;
      // The first test is a weaker bound that costs next to nothing.
      if (best.exists() &&
          ((entropy_ + gate.bits) * (1.0 + 1e-9) < score * gate.cost || bound(h, gate) < score))
        continue;
      consider(g, c);
    }
  }
  return best;
}

Measurement MeasurementChoice::bestOfDrawn(int count, std::mt19937_64& random, double& most_bits) {
  beginStep();
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

Measurement MeasurementChoice::bestOf(int hypothesis) {
  const auto& candidates = mixture_.hypotheses()[slot(hypothesis)].candidates;
  Measurement best;
  double most = 0.0;
  for (int c = 0; c < static_cast<int>(candidates.size()); ++c) {
    const double score = candidates[slot(c)].bits / candidates[slot(c)].cost;
    if (!(score > most) || !isCandidate(hypothesis, c)) continue;
    most = score;
    best = {hypothesis, c, {}};
  }
  if (!best.exists()) return best;
  beginStep();
  best.expected = evaluate(hypothesis, best.candidate);
  return best;
}

Measurement MeasurementChoice::firstOf(int hypothesis) {
  const auto& candidates = mixture_.hypotheses()[slot(hypothesis)].candidates;
  for (int c = 0; c < static_cast<int>(candidates.size()); ++c)
    if (isCandidate(hypothesis, c)) return {hypothesis, c, {}};
  return {};
}

}  // namespace active_matching_slam
