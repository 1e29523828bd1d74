#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "active_matching_slam/matching/search_ellipse.h"
#include "gaussian_mass.h"
#include "mixture.h"

namespace active_matching_slam {
namespace {

/// Features, the first that were searched, on which hypotheses are compared. What comes later has
/// such small ellipses that all who agree on these agree on it too.
constexpr std::size_t kCompared = 24;

std::size_t slot(int i) { return static_cast<std::size_t>(i); }

/// A Gaussian of image points of which one after the other becomes known.
class PredictionChain {
 public:
  PredictionChain(const ProperPrior& prior, std::size_t most)
      : prior_(prior),
        factor_(2 * static_cast<Eigen::Index>(most), 2 * static_cast<Eigen::Index>(most)),
        whitened_(2 * static_cast<Eigen::Index>(most)) {}

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

  /// After predict() of the same feature.
  void learn(int feature, const SearchEllipse& predicted, const Eigen::Vector2d& pixel) {
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
  PredictionChain chain(prior_, features.size());
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

std::vector<Explanation> Mixture::recount() const {
  if (hypotheses_.size() + aside_.size() == 1)
    return {{&hypotheses_.front(), hypotheses_.front().match, kept_}};
  std::vector<int> compared = first_searched_;
  if (compared.size() > kCompared) compared.resize(kCompared);
  std::vector<Explanation> explanations;
  std::vector<double> any;
  const auto judge = [&](const Hypothesis& h) {
    Evidence evidence = evidenceOf(h, compared);
    explanations.push_back({&h, std::move(evidence.match), evidence.log_claimed});
    any.push_back(evidence.log_any);
  };
  for (const Hypothesis& h : hypotheses_) judge(h);
  for (const Hypothesis& h : aside_) judge(h);
  const double most = *std::max_element(any.begin(), any.end());
  double sum = 0.0;
  for (const double log_any : any) sum += std::exp(log_any - most);
  for (Explanation& e : explanations) e.probability = kept_ * std::exp(e.probability - most) / sum;
  std::stable_sort(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return a.probability > b.probability; });
  // One that has waited takes up what was found for the other features too.
  Explanation& accepted = explanations.front();
  if (accepted.hypothesis != &hypotheses_[slot(heaviest())] &&
      first_searched_.size() > compared.size())
    accepted.match = evidenceOf(*accepted.hypothesis, first_searched_).match;
  return explanations;
}

}  // namespace active_matching_slam
