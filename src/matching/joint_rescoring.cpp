#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"
#include "gaussian_mass.h"
#include "mixture.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

/// Cost: a hypothesis is compared with the heaviest on this many features, those searched first,
/// and on this many of those where the two contradict each other. Ellipses of all later features
/// are so small that hypotheses which agree on these agree on the rest too.
constexpr std::size_t kCompared = 16, kContradicted = 8;
/// Cost: most features that a prediction is conditioned on.
constexpr std::size_t kMostKnown = 32;
/// Standard: missed detections beyond their expectation, in sigma of a sum of Bernoulli trials.
constexpr double kMissedDetectionSigmas = 3.0;

/// A joint Gaussian of image points, conditioned on one after the other (chain rule).
class PredictionChain {
 public:
  PredictionChain(const ProperPrior& prior, const Eigen::MatrixXd& S)
      : prior_(prior), S_(S), factor_(2 * kMostKnown, 2 * kMostKnown), whitened_(2 * kMostKnown) {}

  /// Prediction of the feature, given those that are known.
  SearchEllipse predict(int feature) {
    const auto n = static_cast<Eigen::Index>(known_.size());
    spent_ms_ += kPredictionMs + kPredictionSquareMs * static_cast<double>(n * n);
    cross_.resize(2 * n, 2);
    for (Eigen::Index i = 0; i < n; ++i)
      cross_.middleRows<2>(2 * i) =
          S_.block<2, 2>(2 * known_[static_cast<std::size_t>(i)], 2 * feature);
    factor_.topLeftCorner(2 * n, 2 * n).triangularView<Eigen::Lower>().solveInPlace(cross_);
    return {prior_.mean(feature) + cross_.transpose() * whitened_.head(2 * n),
            S_.block<2, 2>(2 * feature, 2 * feature) - cross_.transpose() * cross_};
  }

  /// After predict() of the same feature. Beyond kMostKnown predictions hardly improve.
  void condition(int feature, const SearchEllipse& predicted, const Eigen::Vector2d& pixel) {
    if (known_.size() >= kMostKnown) return;
    const auto n = 2 * static_cast<Eigen::Index>(known_.size());
    const Eigen::Matrix2d root = predicted.covariance.llt().matrixL();
    factor_.block(n, 0, 2, n) = cross_.transpose();
    factor_.block<2, 2>(n, n) = root;
    whitened_.segment<2>(n) = root.triangularView<Eigen::Lower>().solve(pixel - predicted.center);
    known_.push_back(feature);
  }

  /// Modelled, of all predictions so far.
  double spentMilliseconds() const { return spent_ms_; }

 private:
  const ProperPrior& prior_;
  const Eigen::MatrixXd& S_;
  double spent_ms_ = 0.0;
  std::vector<int> known_;
  Eigen::MatrixXd factor_;  // lower Cholesky factor of the covariance of what is known
  Eigen::VectorXd whitened_;
  Eigen::MatrixX2d cross_;
};

}  // namespace

bool Mixture::hasUnclaimedMatches(const Hypothesis& h) const {
  for (const int f : first_searched_) {
    if (h.isFused(f) || !(h.joint->marginal(f).determinant > 0.0)) continue;
    for (const SearchMatch& m : search_.matches(f))
      if (mahalanobisSquared(h.ellipse(f), m.pixel) <= kEllipseRadius2 &&
          !liesInAncestry(h, f, m.pixel))
        return true;
  }
  return false;
}

Mixture::Evidence Mixture::evidenceOf(const Hypothesis& h, const std::vector<int>& features) const {
  constexpr double kLeast = 1e-300;
  Evidence evidence;
  evidence.match = h.match;
  evidence.log_likelihood = h.log_merged + std::log(h.prior->probability);
  PredictionChain chain(prior_, *h.prior->S);
  std::vector<int> open;
  for (const int f : features) {
    const int m = h.match[slot(f)];
    if (m < 0) {
      open.push_back(f);
      continue;
    }
    const SearchEllipse expected = chain.predict(f);
    if (!isProperEllipse(expected)) continue;
    const SearchMatch& found = search_.matches(f)[slot(m)];
    const double p = massOfPixel(found.pixel, expected.center, expected.covariance) / found.clutter;
    evidence.log_likelihood += std::log(std::max(likelihood(f).match * p, kLeast));
    chain.condition(f, expected, found.pixel);
  }
  evidence.log_evidence = evidence.log_likelihood;
  const auto of = [&](int f) { return featureEvidence(h, f, chain.predict(f)); };
  // A match that others found is claimed if that is likelier than not.
  for (const int f : open) {
    if (search_.matches(f).empty()) continue;
    const FeatureEvidence found = of(f);
    if (found.best < 0 || !(found.best_likelihood > 0.5 * found.likelihood)) continue;
    evidence.log_evidence += std::log(found.likelihood);
    evidence.log_likelihood += std::log(found.best_likelihood);
    evidence.match[slot(f)] = found.best;
    chain.condition(f, found.predicted, search_.matches(f)[slot(found.best)].pixel);
  }
  for (const int f : open) {
    if (evidence.match[slot(f)] >= 0) continue;
    const double log_likelihood = std::log(of(f).likelihood);
    evidence.log_evidence += log_likelihood;
    evidence.log_likelihood += log_likelihood;
  }
  charge(chain.spentMilliseconds());
  return evidence;
}

/// match * sum of p over the matches that the hypothesis may claim + in * max(0, A - sum of p over
/// all) + 1 - A
Mixture::FeatureEvidence Mixture::featureEvidence(const Hypothesis& h, int f,
                                                  const SearchEllipse& predicted) const {
  constexpr double kLeast = 1e-9;
  FeatureEvidence evidence;
  evidence.predicted = predicted;
  if (!isProperEllipse(predicted)) return evidence;
  const std::vector<SearchMatch>& known = search_.matches(f);
  const SearchLikelihood& likelihood = this->likelihood(f);
  double all = 0.0, free = 0.0;
  for (int m = 0; m < static_cast<int>(known.size()); ++m) {
    const Eigen::Vector2d& pixel = known[slot(m)].pixel;
    double p = massOfPixel(pixel, predicted.center, predicted.covariance);
    all += p;
    if (liesInAncestry(h, f, pixel)) continue;
    p /= known[slot(m)].clutter;
    free += p;
    if (likelihood.match * p <= evidence.best_likelihood ||
        !(mahalanobisSquared(predicted, pixel) <= kEllipseRadius2))
      continue;
    evidence.best_likelihood = likelihood.match * p;
    evidence.best = m;
  }
  charge(kRunMs * static_cast<double>(search_.searchedPixels(f).history().size()));
  const double searched = std::min(
      1.0, massOnPixels(search_.searchedPixels(f), predicted.center, predicted.covariance));
  const double missed = likelihood.in * std::max(0.0, searched - all) + 1.0 - searched;
  evidence.likelihood = std::max(likelihood.match * free + missed, kLeast);
  return evidence;
}

/// Features, not among the first `skipped` searched, for which one accepts a match that the other
/// denies.
std::vector<int> Mixture::contradictions(const Hypothesis& a, const Hypothesis& b,
                                         std::size_t skipped) const {
  const auto denies = [&](const Hypothesis& h, int f, int match) {
    return h.isFused(f) ? h.match[slot(f)] != match
                        : liesInAncestry(h, f, search_.matches(f)[slot(match)].pixel);
  };
  std::vector<int> features;
  for (std::size_t i = skipped; i < first_searched_.size(); ++i) {
    const int f = first_searched_[i];
    if (features.size() >= kContradicted) break;
    if ((a.isFused(f) && denies(b, f, a.match[slot(f)])) ||
        (b.isFused(f) && denies(a, f, b.match[slot(f)])))
      features.push_back(f);
  }
  return features;
}

std::vector<Explanation> Mixture::rescoreJointly() const {
  const Hypothesis& leader = hypotheses_[slot(heaviest())];
  if (hypotheses_.size() + pruned_.size() + completed_.size() == 1)
    return {{&leader, leader.match, kept_}};
  const std::vector<int> first(first_searched_.begin(),
                               first_searched_.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                             first_searched_.size(), kCompared)));
  const Evidence of_leader = evidenceOf(leader, first);
  std::vector<Explanation> explanations;
  double sum = 0.0;
  const auto score = [&](const Hypothesis& h) {
    std::vector<int> compared = contradictions(leader, h, first.size());
    const bool on_first = compared.empty();
    compared.insert(compared.begin(), first.begin(), first.end());
    Evidence evidence = &h == &leader ? of_leader : evidenceOf(h, compared);
    const double base =
        on_first ? of_leader.log_evidence : evidenceOf(leader, compared).log_evidence;
    explanations.push_back(
        {&h, std::move(evidence.match), std::exp(evidence.log_likelihood - base)});
    sum += std::exp(evidence.log_evidence - base);
  };
  for (const Hypothesis& h : hypotheses_) score(h);
  for (const Hypothesis& h : completed_) score(h);
  for (const Hypothesis& h : pruned_) score(h);
  for (Explanation& e : explanations) e.probability *= kept_ / sum;
  std::stable_sort(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return a.probability > b.probability; });
  // Of an alternative, the matches of the remaining features are completed too.
  Explanation& accepted = explanations.front();
  if (accepted.hypothesis != &leader && first_searched_.size() > first.size())
    accepted.match = evidenceOf(*accepted.hypothesis, first_searched_).match;
  return explanations;
}

bool Mixture::heaviestMissesTooMany() const {
  const Hypothesis& h = hypotheses_[slot(heaviest())];
  double missed = 0.0, expected = 0.0, variance = 0.0;
  for (int f = 0; f < features(); ++f) {
    if (h.ancestry[slot(f)] < 0 && !h.isFused(f)) continue;  // never searched
    const double found = likelihood(f).true_positive * kEllipseMass;
    missed += !h.isFused(f);
    expected += 1.0 - found;
    variance += found * (1.0 - found);
  }
  return missed > expected + kMissedDetectionSigmas * std::sqrt(variance) + 1.0;
}

bool Mixture::beginAlternative() {
  const int first = heaviest();
  for (int k = 0; k < static_cast<int>(hypotheses_.size()); ++k) {
    Hypothesis& h = hypotheses_[slot(k)];
    if (k != first) (h.hasOpenCandidate() ? pruned_ : completed_).push_back(std::move(h));
  }
  Hypothesis done = std::move(hypotheses_[slot(first)]);
  hypotheses_.clear();
  const auto next = std::max_element(
      pruned_.begin(), pruned_.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.most_weight < b.most_weight; });
  if (next == pruned_.end() || next->most_weight < kAlternativeWeight) {
    hypotheses_.push_back(std::move(done));
    return false;
  }
  hypotheses_.push_back(std::move(*next));
  Hypothesis& begun = hypotheses_.front();
  beginTerms(begun);
  begun.weight = 1.0;
  begun.log_weight = 0.0;
  pruned_.erase(next);
  completed_.push_back(std::move(done));
  return true;
}

}  // namespace active_matching_slam
