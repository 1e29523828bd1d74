#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"
#include "gaussian_mass.h"
#include "mixture.h"

namespace active_matching_slam {
namespace {

/// A hypothesis is compared with the heaviest on so many features, those that were searched first,
/// and on so many of those where the two contradict each other. All others have such small ellipses
/// that who agrees on these agrees on them too.
constexpr std::size_t kCompared = 16, kContradicted = 8;
/// Others are predicted from so many at most.
constexpr std::size_t kMostKnown = 32;
/// Features missed beyond what their rates explain that make one doubt.
constexpr double kSurpriseSigmas = 3.0;

/// A Gaussian of image points of which one after the other becomes known.
class PredictionChain {
 public:
  explicit PredictionChain(const ProperPrior& prior)
      : prior_(prior), factor_(2 * kMostKnown, 2 * kMostKnown), whitened_(2 * kMostKnown) {}

  /// Where the feature is expected, given those that are known.
  SearchEllipse predict(int feature) {
    const auto n = static_cast<Eigen::Index>(known_.size());
    cross_.resize(2 * n, 2);
    for (Eigen::Index i = 0; i < n; ++i)
      cross_.middleRows<2>(2 * i) =
          prior_.S().block<2, 2>(2 * known_[static_cast<std::size_t>(i)], 2 * feature);
    factor_.topLeftCorner(2 * n, 2 * n).triangularView<Eigen::Lower>().solveInPlace(cross_);
    return {prior_.mean(feature) + cross_.transpose() * whitened_.head(2 * n),
            prior_.covariance(feature) - cross_.transpose() * cross_};
  }

  /// After predict() of the same feature. What comes after kMostKnown changes little.
  void learn(int feature, const SearchEllipse& predicted, const Eigen::Vector2d& pixel) {
    if (known_.size() >= kMostKnown) return;
    const auto n = 2 * static_cast<Eigen::Index>(known_.size());
    const Eigen::Matrix2d root = predicted.covariance.llt().matrixL();
    factor_.block(n, 0, 2, n) = cross_.transpose();
    factor_.block<2, 2>(n, n) = root;
    whitened_.segment<2>(n) = root.triangularView<Eigen::Lower>().solve(pixel - predicted.center);
    known_.push_back(feature);
  }

 private:
  const ProperPrior& prior_;
  std::vector<int> known_;
  Eigen::MatrixXd factor_;  // lower Cholesky factor of the covariance of what is known
  Eigen::VectorXd whitened_;
  Eigen::MatrixX2d cross_;
};

}  // namespace

bool Mixture::lags(const Hypothesis& h) const {
  for (const int f : first_searched_) {
    if (h.isFused(f) || !(h.joint->marginal(f).determinant > 0.0)) continue;
    for (const SearchMatch& m : ledger_.matches(f))
      if (mahalanobisSquared(h.ellipse(f), m.pixel) <= kEllipseRadius2 &&
          !liesInLineage(h, f, m.pixel))
        return true;
  }
  return false;
}

Mixture::Evidence Mixture::evidenceOf(const Hypothesis& h, const std::vector<int>& features) const {
  constexpr double kLeast = 1e-300;
  Evidence evidence;
  evidence.match = h.match;
  evidence.log_claimed = h.log_merged;
  PredictionChain chain(prior_);
  std::vector<int> open;
  for (const int f : features) {
    const int m = h.match[slot(f)];
    if (m < 0) {
      open.push_back(f);
      continue;
    }
    const SearchEllipse expected = chain.predict(f);
    if (!isProperEllipse(expected)) continue;
    const Eigen::Vector2d& pixel = ledger_.matches(f)[slot(m)].pixel;
    const double p = massOfPixel(pixel, expected.center, expected.covariance);
    evidence.log_claimed += std::log(std::max(likelihood(f).match * p, kLeast));
    chain.learn(f, expected, pixel);
  }
  evidence.log_any = evidence.log_claimed;
  const auto view = [&](int f) { return viewOf(h, f, chain.predict(f)); };
  // What others found is taken up if that is likelier than not.
  for (const int f : open) {
    if (ledger_.matches(f).empty()) continue;
    const View seen = view(f);
    if (seen.best < 0 || !(seen.of_best > 0.5 * seen.any)) continue;
    evidence.log_any += std::log(seen.any);
    evidence.log_claimed += std::log(seen.of_best);
    evidence.match[slot(f)] = seen.best;
    chain.learn(f, seen.expected, ledger_.matches(f)[slot(seen.best)].pixel);
  }
  for (const int f : open) {
    if (evidence.match[slot(f)] >= 0) continue;
    const double any = std::log(view(f).any);
    evidence.log_any += any;
    evidence.log_claimed += any;
  }
  return evidence;
}

/// match * sum of p over what the hypothesis may claim + in * max(0, A - sum of p over all) + 1 - A
Mixture::View Mixture::viewOf(const Hypothesis& h, int f, const SearchEllipse& expected) const {
  constexpr double kLeast = 1e-9;
  View seen;
  seen.expected = expected;
  if (!isProperEllipse(expected)) return seen;
  const std::vector<SearchMatch>& known = ledger_.matches(f);
  const SearchLikelihood& likelihood = this->likelihood(f);
  double all = 0.0, free = 0.0;
  for (int m = 0; m < static_cast<int>(known.size()); ++m) {
    const Eigen::Vector2d& pixel = known[slot(m)].pixel;
    const double p = massOfPixel(pixel, expected.center, expected.covariance);
    all += p;
    if (liesInLineage(h, f, pixel)) continue;
    free += p;
    if (likelihood.match * p <= seen.of_best ||
        !(mahalanobisSquared(expected, pixel) <= kEllipseRadius2))
      continue;
    seen.of_best = likelihood.match * p;
    seen.best = m;
  }
  const double searched =
      std::min(1.0, massOnPixels(ledger_.searchedPixels(f), expected.center, expected.covariance));
  const double missed = likelihood.in * std::max(0.0, searched - all) + 1.0 - searched;
  seen.any = std::max(likelihood.match * free + missed, kLeast);
  return seen;
}

/// Features, not among the first `skipped` searched, for which one accepts a match that the other
/// denies.
std::vector<int> Mixture::contradictions(const Hypothesis& a, const Hypothesis& b,
                                         std::size_t skipped) const {
  const auto denies = [&](const Hypothesis& h, int f, int match) {
    return h.isFused(f) ? h.match[slot(f)] != match
                        : liesInLineage(h, f, ledger_.matches(f)[slot(match)].pixel);
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

std::vector<Explanation> Mixture::recount() const {
  const Hypothesis& leader = hypotheses_[slot(heaviest())];
  if (hypotheses_.size() + aside_.size() + ended_.size() == 1)
    return {{&leader, leader.match, kept_}};
  const std::vector<int> first(first_searched_.begin(),
                               first_searched_.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                             first_searched_.size(), kCompared)));
  const Evidence of_leader = evidenceOf(leader, first);
  std::vector<Explanation> explanations;
  double sum = 0.0;
  const auto judge = [&](const Hypothesis& h) {
    std::vector<int> compared = contradictions(leader, h, first.size());
    const bool on_first = compared.empty();
    compared.insert(compared.begin(), first.begin(), first.end());
    Evidence evidence = &h == &leader ? of_leader : evidenceOf(h, compared);
    const double base = on_first ? of_leader.log_any : evidenceOf(leader, compared).log_any;
    explanations.push_back({&h, std::move(evidence.match), std::exp(evidence.log_claimed - base)});
    sum += std::exp(evidence.log_any - base);
  };
  for (const Hypothesis& h : hypotheses_) judge(h);
  for (const Hypothesis& h : ended_) judge(h);
  for (const Hypothesis& h : aside_) judge(h);
  for (Explanation& e : explanations) e.probability *= kept_ / sum;
  std::stable_sort(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return a.probability > b.probability; });
  // One that has waited takes up what was found for the other features too.
  Explanation& accepted = explanations.front();
  if (accepted.hypothesis != &leader && first_searched_.size() > first.size())
    accepted.match = evidenceOf(*accepted.hypothesis, first_searched_).match;
  return explanations;
}

bool Mixture::heaviestFallsShort() const {
  const Hypothesis& h = hypotheses_[slot(heaviest())];
  double missed = 0.0, expected = 0.0, variance = 0.0;
  for (int f = 0; f < features(); ++f) {
    if (h.lineage[slot(f)] < 0 && !h.isFused(f)) continue;  // never searched
    const double found = likelihood(f).true_positive * kEllipseMass;
    missed += !h.isFused(f);
    expected += 1.0 - found;
    variance += found * (1.0 - found);
  }
  return missed > expected + kSurpriseSigmas * std::sqrt(variance) + 1.0;
}

bool Mixture::beginRunnerUp() {
  const int first = heaviest();
  for (int k = 0; k < static_cast<int>(hypotheses_.size()); ++k) {
    Hypothesis& h = hypotheses_[slot(k)];
    if (k != first) (h.hasOpenCandidate() ? aside_ : ended_).push_back(std::move(h));
  }
  Hypothesis done = std::move(hypotheses_[slot(first)]);
  hypotheses_.clear();
  const auto next = std::max_element(
      aside_.begin(), aside_.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.most_weight < b.most_weight; });
  if (next == aside_.end() || next->most_weight < kRunnerUpWeight) {
    hypotheses_.push_back(std::move(done));
    return false;
  }
  hypotheses_.push_back(std::move(*next));
  Hypothesis& begun = hypotheses_.front();
  beginTerms(begun);
  begun.weight = 1.0;
  begun.log_weight = 0.0;
  aside_.erase(next);
  ended_.push_back(std::move(done));
  return true;
}

}  // namespace active_matching_slam
