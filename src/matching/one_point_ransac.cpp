#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <random>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "baseline_matchers.h"
#include "gate_search.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

/// Which of the features in `voters` become hypotheses: all, or a seeded sample, ascending.
std::vector<int> drawHypotheses(std::vector<int> voters, const MatchOptions& options) {
  const auto wanted = static_cast<std::size_t>(options.ransac_max_hypotheses);
  if (wanted == 0 || voters.size() <= wanted) return voters;
  std::mt19937_64 random(options.seed);
  for (std::size_t i = 0; i < wanted; ++i)
    std::swap(voters[i], voters[i + random() % (voters.size() - i)]);
  voters.resize(wanted);
  std::sort(voters.begin(), voters.end());
  return voters;
}

/// Image points of some features together: what they differ from the prior by, and its covariance.
struct Stacked {
  Eigen::VectorXd innovation;
  Eigen::MatrixXd S;
};

Stacked stack(const ProperPrior& prior, const std::vector<int>& features,
              const std::vector<Eigen::Vector2d>& pixels) {
  const int n = static_cast<int>(features.size());
  Stacked stacked{Eigen::VectorXd(2 * n), selectFeatures(prior.S(), features)};
  for (int a = 0; a < n; ++a) {
    const auto slot = static_cast<std::size_t>(a);
    stacked.innovation.segment<2>(2 * a) = pixels[slot] - prior.mean(features[slot]);
  }
  return stacked;
}

/// Of all matches together from what the prior expects.
double jointDistance2(const ProperPrior& prior, const BudgetedSearch& budgeted,
                      const std::vector<int>& match_of_feature) {
  std::vector<int> matched;
  std::vector<Eigen::Vector2d> pixels;
  for (int f = 0; f < prior.size(); ++f) {
    const int match = match_of_feature[static_cast<std::size_t>(prior.original(f))];
    if (match < 0) continue;
    matched.push_back(f);
    pixels.push_back(budgeted.matches(f)[static_cast<std::size_t>(match)].pixel);
  }
  const Stacked all = stack(prior, matched, pixels);
  return all.S.llt().matrixL().solve(all.innovation).squaredNorm();
}

/// One frame's problem: `best[f]` is the match of highest score in the prior's gate, or -1.
class OnePointRansac {
 public:
  OnePointRansac(const ProperPrior& prior, const BudgetedSearch& budgeted, std::vector<int> best)
      : prior_(prior), search_(budgeted), best_(std::move(best)) {}

  /// The low-innovation inliers of the best hypothesis.
  std::vector<int> inliers(const std::vector<int>& hypotheses, double chi2) const {
    const Eigen::VectorXd R = prior_.noiseVariances();
    std::vector<int> most;
    for (const int h : hypotheses) {
      const Eigen::Vector2d weighted =
          prior_.covariance(h).inverse() * (bestPixel(h) - prior_.mean(h));
      std::vector<int> inliers;
      for (int f = 0; f < prior_.size(); ++f) {
        if (best_[static_cast<std::size_t>(f)] < 0) continue;
        const Eigen::Vector2d expected =
            prior_.mean(f) + prior_.S().block<2, 2>(2 * f, 2 * h) * weighted;
        if (f == h || (bestPixel(f) - expected).squaredNorm() < chi2 * R[f]) inliers.push_back(f);
      }
      if (inliers.size() > most.size()) most = std::move(inliers);
    }
    return most;
  }

  /// For each feature outside `inliers` the match of its gate that is nearest to what the inliers
  /// predict, if inside their gate; -1 for the rest.
  std::vector<int> rescued(const std::vector<int>& inliers,
                           const std::vector<std::vector<int>>& gates, double gate2) const {
    std::vector<int> rescued(static_cast<std::size_t>(prior_.size()), -1);
    const int n = 2 * static_cast<int>(inliers.size());
    std::vector<Eigen::Vector2d> pixels;
    for (const int i : inliers) pixels.push_back(bestPixel(i));
    const Stacked stacked = stack(prior_, inliers, pixels);
    const Eigen::LLT<Eigen::MatrixXd> llt(stacked.S);
    if (llt.info() != Eigen::Success) return rescued;
    const Eigen::VectorXd y = llt.matrixL().solve(stacked.innovation);
    std::vector<bool> is_inlier(static_cast<std::size_t>(prior_.size()), false);
    for (const int i : inliers) is_inlier[static_cast<std::size_t>(i)] = true;
    Eigen::MatrixXd cross(n, 2);
    for (int f = 0; f < prior_.size(); ++f) {
      const auto slot = static_cast<std::size_t>(f);
      if (is_inlier[slot] || gates[slot].empty()) continue;
      for (int a = 0; a < n / 2; ++a)
        cross.middleRows<2>(2 * a) =
            prior_.S().block<2, 2>(2 * inliers[static_cast<std::size_t>(a)], 2 * f);
      llt.matrixL().solveInPlace(cross);
      const SearchEllipse conditional{prior_.mean(f) + cross.transpose() * y,
                                      prior_.covariance(f) - cross.transpose() * cross};
      if (!isProperEllipse(conditional)) continue;
      double nearest = gate2;
      for (const int m : gates[slot]) {
        const double d2 =
            mahalanobisSquared(conditional, search_.matches(f)[static_cast<std::size_t>(m)].pixel);
        if (d2 > nearest || (rescued[slot] >= 0 && d2 == nearest)) continue;
        nearest = d2;
        rescued[slot] = m;
      }
    }
    return rescued;
  }

 private:
  const Eigen::Vector2d& bestPixel(int f) const {
    return search_.matches(f)[static_cast<std::size_t>(best_[static_cast<std::size_t>(f)])].pixel;
  }

  const ProperPrior& prior_;
  const BudgetedSearch& search_;
  std::vector<int> best_;
};

}  // namespace

MatchResult OnePointRansacMatcher::match(const MeasurementPrior& given, FeatureSearch& search,
                                         const MatchOptions& options) {
  const ProperPrior prior(given);
  BudgetedSearch budgeted(prior, search, options);
  MatchResult result = budgeted.begin("one_point_ransac");
  const auto gates = searchFullGates(prior, budgeted, &result.statistics.cut_short);
  std::vector<int> best, voters;
  for (int f = 0; f < prior.size(); ++f) {
    best.push_back(bestScore(budgeted.matches(f), gates[static_cast<std::size_t>(f)]));
    if (best.back() >= 0) voters.push_back(f);
  }
  const std::vector<int> hypotheses = drawHypotheses(voters, options);
  result.statistics.nodes = static_cast<std::int64_t>(hypotheses.size());
  budgeted.charge(kVoteMs * static_cast<double>(hypotheses.size() * voters.size()));
  const OnePointRansac ransac(prior, budgeted, best);
  const std::vector<int> inliers = ransac.inliers(hypotheses, options.ransac_inlier_chi2);
  result.statistics.inliers = static_cast<int>(inliers.size());
  if (!inliers.empty()) {
    const std::vector<int> rescued = ransac.rescued(inliers, gates, options.ransac_rescue_chi2);
    for (int f = 0; f < prior.size(); ++f)
      result.match_of_feature[static_cast<std::size_t>(prior.original(f))] =
          rescued[static_cast<std::size_t>(f)];
    for (const int i : inliers)
      result.match_of_feature[static_cast<std::size_t>(prior.original(i))] =
          best[static_cast<std::size_t>(i)];
    result.statistics.mahalanobis2 = jointDistance2(prior, budgeted, result.match_of_feature);
  }
  budgeted.finish(result);
  return result;
}

}  // namespace active_matching_slam
