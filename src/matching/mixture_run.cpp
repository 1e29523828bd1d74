#include "mixture_run.h"

#include <algorithm>

#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

/// Cost: fraction of the budget after which the search commits to the heaviest Gaussian whether it
/// dominates or not.
constexpr double kCommitFraction = 0.75;
/// Cost: the same after which nothing more is searched, so that what is known can be re-scored.
constexpr double kSearchFraction = 0.9;

std::vector<SearchLikelihood> likelihoodsOf(const MeasurementPrior& given, const ProperPrior& prior,
                                            const MatchOptions& options) {
  std::vector<SearchLikelihood> likelihoods;
  for (int f = 0; f < prior.size(); ++f)
    likelihoods.emplace_back(given.rates.empty() ? options.default_rates
                                                 : given.rates[slot(prior.original(f))]);
  return likelihoods;
}

/// Of the features without a match.
double informationLeft(const Hypothesis& h, const std::vector<int>& match) {
  double bits = 0.0;
  for (std::size_t f = 0; f < match.size(); ++f)
    if (match[f] < 0) bits += h.joint->marginal(static_cast<int>(f)).information_bits;
  return bits;
}

}  // namespace

MixtureRun::MixtureRun(const MeasurementPrior& given, const ProperPrior& prior,
                       const std::vector<PriorGaussian>& gaussians, BudgetedSearch& budgeted,
                       const MatchOptions& options, Policy policy)
    : prior_(prior),
      search_(budgeted),
      options_(options),
      policy_(policy),
      mixture_(prior, gaussians, budgeted, likelihoodsOf(given, prior, options), options),
      choice_(mixture_, options.update_rule == UpdateRule::kIncremental),
      random_(options.seed) {}

void MixtureRun::run(MatchResult& result) {
  MatchStatistics& statistics = result.statistics;
  const Hypothesis& root = mixture_.hypotheses().front();
  statistics.information_bits_start = informationLeft(root, root.match);
  const double correlation_before = search_.correlationSeconds();
  const double start = search_.now();
  double information_s = searchToEnd(result);
  int alternatives = mixture_.rescoresJointly() ? options_.k_best : 0;
  while (alternatives-- > 0 && !statistics.cut_short && mixture_.heaviestMissesTooMany() &&
         mixture_.beginAlternative()) {
    latched_ = false;
    information_s += searchToEnd(result);
  }
  statistics.cut_short |= mixture_.wasCapped();
  report(result);
  const double correlation_s = search_.correlationSeconds() - correlation_before;
  statistics.information_ms += 1e3 * information_s;
  statistics.mixture_ms += 1e3 * (search_.now() - start - information_s - correlation_s);
}

double MixtureRun::searchToEnd(MatchResult& result) {
  double information_s = 0.0;
  while (!isFinished()) {
    const bool dominates =
        policy_ == Policy::kFast && latched_ &&
        mixture_.hypotheses()[slot(mixture_.heaviest())].weight > options_.fast_accept_weight;
    const bool must_end = search_.fractionUsed() >= kCommitFraction;
    if (dominates || must_end) {
      result.statistics.cut_short |= must_end;
      if (!latched_) latch();
      acceptNearest(result);
      break;
    }
    const double before_choice = search_.now();
    const Measurement next = choose();
    information_s += search_.now() - before_choice;
    if (!next.exists()) break;
    MatchStep step = begin(next);
    mixture_.searchAndUpdate(next.hypothesis, next.candidate, step);
    record(std::move(step), result);
  }
  return information_s;
}

bool MixtureRun::isFinished() const {
  if (options_.finish_weight <= 0.0) return false;
  const Hypothesis& h = mixture_.hypotheses()[slot(mixture_.heaviest())];
  return h.weight >= options_.finish_weight && !h.hasOpenCandidate();
}

Measurement MixtureRun::choose() {
  const int unconfirmed = mixture_.unconfirmed();
  if (unconfirmed >= 0) {
    const Measurement next = choice_.bestOf(unconfirmed);
    if (next.exists()) return next;
  }
  if (latched_) return chooseAfterLatch();
  if (policy_ == Policy::kFast) {
    double most_bits = 0.0;
    const Measurement next = choice_.bestOfDrawn(options_.fast_candidates, random_, most_bits);
    if (next.exists() && most_bits < options_.fast_latch_bits) latch();
    return next;
  }
  const Measurement next = choice_.best();
  if (!next.exists() || next.expected.bits() >= options_.latch_information_bits) return next;
  if (options_.latch_information_bits <= 0.0) return next;
  latch();
  return chooseAfterLatch();
}

void MixtureRun::latch() {
  latched_ = true;
  mixture_.forgetTerms();
}

/// The heaviest Gaussian's lowest candidate; FAM goes on to the next heaviest when it has none.
Measurement MixtureRun::chooseAfterLatch() {
  if (policy_ == Policy::kFull) return choice_.firstOf(mixture_.heaviest());
  std::vector<int> order;
  for (int k = 0; k < static_cast<int>(mixture_.hypotheses().size()); ++k) order.push_back(k);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return mixture_.hypotheses()[slot(a)].weight > mixture_.hypotheses()[slot(b)].weight;
  });
  for (const int k : order) {
    const Measurement next = choice_.firstOf(k);
    if (next.exists()) return next;
  }
  return {};
}

/// Nearest neighbour: the heaviest Gaussian, which dominates or is committed to, takes the match
/// nearest to each of its remaining predictions.
void MixtureRun::acceptNearest(MatchResult& result) {
  const int dominant = mixture_.heaviest();
  while (true) {
    const Measurement next = choice_.firstOf(dominant);
    if (!next.exists()) return;
    if (search_.fractionUsed() >= kSearchFraction) {
      result.statistics.cut_short = true;
      return;
    }
    MatchStep step = begin(next);
    const int feature =
        mixture_.hypotheses()[slot(dominant)].candidates[slot(next.candidate)].feature;
    const SearchOutcome outcome = mixture_.searchOnly(dominant, next.candidate);
    step.pixels_in_ellipse = outcome.pixels_in_ellipse;
    step.pixels_new = outcome.pixels_new;
    step.matches = outcome.matches;
    int nearest = -1;
    double nearest2 = 0.0;
    for (const int m : outcome.matches) {
      const double d2 = mahalanobisSquared(step.ellipse, search_.matches(feature)[slot(m)].pixel);
      if (nearest >= 0 && d2 >= nearest2) continue;
      nearest = m;
      nearest2 = d2;
    }
    if (nearest >= 0) {
      mixture_.fuse(dominant, next.candidate, nearest);
      step.spawned.push_back(nearest);
    }
    record(std::move(step), result);
  }
}

MatchStep MixtureRun::begin(const Measurement& measurement) const {
  const Hypothesis& h = mixture_.hypotheses()[slot(measurement.hypothesis)];
  const Hypothesis::Candidate& candidate = h.candidates[slot(measurement.candidate)];
  MatchStep step;
  step.feature = prior_.original(candidate.feature);
  step.gaussian = h.id;
  step.ellipse = h.ellipse(candidate.feature);
  step.area_px = candidate.area;
  step.evaluated = measurement.expected.null_probability > 0.0;
  step.discrete_information_bits = measurement.expected.discrete_bits;
  step.continuous_information_bits = measurement.expected.continuous_bits;
  step.mutual_information_bits = h.joint->marginal(candidate.feature).information_bits;
  step.score = measurement.expected.score;
  step.null_probability = measurement.expected.null_probability;
  return step;
}

void MixtureRun::record(MatchStep step, MatchResult& result) const {
  if (options_.keep_trace) result.trace.push_back(std::move(step));
}

std::vector<int> MixtureRun::matchesOf(const Explanation& e) const {
  std::vector<int> matches(slot(prior_.size() + prior_.leftOut()), -1);
  for (int f = 0; f < prior_.size(); ++f)
    if (e.hypothesis->match_probability[slot(f)] >= options_.merge_probability)
      matches[slot(prior_.original(f))] = e.match[slot(f)];
  return matches;
}

void MixtureRun::report(MatchResult& result) const {
  const std::vector<Explanation> all =
      mixture_.rescoresJointly() ? mixture_.rescoreJointly() : mixture_.explanations();
  const Explanation& accepted = all.front();
  MatchStatistics& statistics = result.statistics;
  result.is_wide = accepted.hypothesis->prior != mixture_.firstPrior();
  statistics.max_gaussians = mixture_.mostGaussians();
  statistics.accepted_weight = accepted.probability;
  statistics.information_bits_end = informationLeft(*accepted.hypothesis, accepted.match);
  statistics.dropped_probability = 1.0;
  for (const Explanation& e : all) {
    if (e.probability < options_.prune_weight && &e != &accepted) break;
    result.hypotheses.push_back(
        {e.hypothesis->id, e.hypothesis->parent, e.probability, matchesOf(e)});
    statistics.dropped_probability -= e.probability;
  }
  statistics.dropped_probability = std::max(statistics.dropped_probability, 0.0);
  result.match_of_feature = result.hypotheses.front().match_of_feature;
  statistics.ambiguous = accepted.probability < options_.ambiguous_below_weight;
  if (!statistics.ambiguous) return;
  // The most probable hypotheses that together reach the required probability must agree.
  double together = accepted.probability;
  for (std::size_t k = 1;
       k < result.hypotheses.size() && together < options_.ambiguous_below_weight; ++k) {
    together += all[k].probability;
    for (int f = 0; f < prior_.size(); ++f) {
      int& match = result.match_of_feature[slot(prior_.original(f))];
      if (match >= 0 && !agrees(all[k], f, match)) match = -1;
    }
  }
}

/// Whether `e` has accepted the match, or would find it in an ellipse that it has not searched yet.
bool MixtureRun::agrees(const Explanation& e, int feature, int match) const {
  const Hypothesis& h = *e.hypothesis;
  const int c = h.candidate_of[slot(feature)];
  if (e.match[slot(feature)] >= 0 || c < 0 || !h.candidates[slot(c)].open)
    return e.match[slot(feature)] == match;
  return mahalanobisSquared(h.ellipse(feature), search_.matches(feature)[slot(match)].pixel) <=
         kEllipseRadius2;
}

}  // namespace active_matching_slam
