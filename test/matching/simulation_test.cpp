#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/matching/simulated_problem.h"

namespace active_matching_slam {
namespace {

bool isEntirelyRight(const SimulatedProblem& problem, const PointListSearch& search,
                     const std::vector<int>& matches) {
  for (int f = 0; f < problem.prior.size(); ++f) {
    const auto slot = static_cast<std::size_t>(f);
    const int match = matches[slot];
    const int point = match < 0 ? -1 : search.matches(f)[static_cast<std::size_t>(match)].id;
    if (point != problem.true_point[slot]) return false;
  }
  return true;
}

struct Score {
  int right = 0;
  double pixels = 0.0;
};

Score scoreOf(const std::string& matcher, const SimulatedProblemOptions& options, int frames) {
  ProblemSimulator simulator(options, 11);
  MatchOptions match_options;
  match_options.max_gaussians = 64;
  Score score;
  for (int n = 0; n < frames; ++n) {
    const SimulatedProblem problem = simulator.next();
    PointListSearch search = problem.search();
    const MatchResult result = createMatcher(matcher)->match(problem.prior, search, match_options);
    score.right += isEntirelyRight(problem, search, result.match_of_feature);
    score.pixels += static_cast<double>(result.statistics.pixels_searched);
  }
  return score;
}

TEST(ActiveMatching, IsRightAtLeastAsOftenAsJcbbInClutter) {
  SimulatedProblemOptions options;
  options.false_positive = 1e-4;
  const Score active = scoreOf("active", options, 500), jcbb = scoreOf("jcbb", options, 500);
  EXPECT_GE(active.right, jcbb.right);
  EXPECT_LT(2.0 * active.pixels, jcbb.pixels);
}

TEST(ActiveMatching, IsRightMoreOftenThanJcbbWhereStructureRepeats) {
  SimulatedProblemOptions options;
  options.false_positive = 1e-4;
  options.repeated_share = 0.5;
  EXPECT_GT(scoreOf("active", options, 500).right, scoreOf("jcbb", options, 500).right);
}

/// Whether what the accepted hypothesis claims is true: its matches are the features, and the
/// features without a match did not answer in the ellipses that it and its ancestors searched.
bool claimIsTrue(const SimulatedProblem& problem, const PointListSearch& search,
                 const MatchResult& result) {
  const MatchHypothesis& accepted = result.hypotheses.front();
  std::map<int, std::size_t> birth;  // of a Gaussian: the step that made it
  for (std::size_t step = 0; step < result.trace.size(); ++step)
    for (const auto& entry : result.trace[step].weights)
      if (entry.gaussian > 0) birth.emplace(entry.gaussian, step);
  std::map<int, int> parent;
  for (const MatchStep& step : result.trace)
    for (const auto& entry : step.weights) parent[entry.gaussian] = entry.parent;
  std::vector<std::vector<SearchEllipse>> lineage(accepted.match_of_feature.size());
  std::size_t until = result.trace.size();
  for (int id = accepted.gaussian; id >= 0; id = parent[id]) {
    for (std::size_t step = 0; step < until; ++step)
      if (result.trace[step].gaussian == id)
        lineage[static_cast<std::size_t>(result.trace[step].feature)].push_back(
            result.trace[step].ellipse);
    if (id > 0) until = birth.at(id) + 1;
  }
  for (int f = 0; f < problem.prior.size(); ++f) {
    const auto slot = static_cast<std::size_t>(f);
    const int match = accepted.match_of_feature[slot], truth = problem.true_point[slot];
    if (match >= 0) {
      if (search.matches(f)[static_cast<std::size_t>(match)].id != truth) return false;
    } else if (truth >= 0) {
      for (const SearchEllipse& ellipse : lineage[slot])
        if (mahalanobisSquared(ellipse, problem.points[slot][static_cast<std::size_t>(truth)]) <=
            kEllipseRadius2)
          return false;
    }
  }
  return true;
}

TEST(ActiveMatching, WeightOfTheAcceptedHypothesisIsAProbability) {
  constexpr int kBins = 5, kFrames = 700;
  constexpr double kSystematic = 0.03;  // of rule incremental: a child keeps its parent's view
  double weight[kBins] = {}, right[kBins] = {}, count[kBins] = {};
  MatchOptions options;
  options.max_gaussians = 64;
  options.keep_trace = true;
  std::uint64_t seed = 20;
  for (const double clutter : {2e-5, 1e-4, 2e-4, 4e-4}) {
    SimulatedProblemOptions problem_options;
    problem_options.false_positive = clutter;
    ProblemSimulator simulator(problem_options, ++seed);
    for (int n = 0; n < kFrames; ++n) {
      const SimulatedProblem problem = simulator.next();
      PointListSearch search = problem.search();
      const MatchResult result = createMatcher("active")->match(problem.prior, search, options);
      const double w = result.statistics.accepted_weight;
      const int bin = std::min(static_cast<int>(w * kBins), kBins - 1);
      weight[bin] += w;
      right[bin] += claimIsTrue(problem, search, result);
      count[bin] += 1.0;
    }
  }
  for (int bin = 0; bin < kBins; ++bin) {
    if (count[bin] < 30) continue;
    const double predicted = weight[bin] / count[bin];
    const double sigma = std::sqrt(predicted * (1.0 - predicted) / count[bin]);
    EXPECT_NEAR(predicted, right[bin] / count[bin], 3.0 * sigma + kSystematic)
        << count[bin] << " frames with weights about " << predicted;
  }
  EXPECT_GT(count[kBins - 1], 1000);
}

TEST(ChowLiuMatching, EqualsActiveMatchingOnTheCovarianceOfTheTree) {
  SimulatedProblemOptions options;
  options.features = 15;
  options.false_positive = 1e-4;
  ProblemSimulator simulator(options, 5);
  MatchOptions match_options;
  match_options.keep_trace = true;
  for (int n = 0; n < 20; ++n) {
    SimulatedProblem problem = simulator.next();
    PointListSearch tree_search = problem.search(), dense_search = problem.search();
    const MatchResult tree =
        createMatcher("chow_liu")->match(problem.prior, tree_search, match_options);
    EXPECT_EQ(14u, tree.tree_edges.size());
    problem.prior.S = treeCovariance(chowLiuTree(problem.prior.S));
    const MatchResult dense =
        createMatcher("active")->match(problem.prior, dense_search, match_options);
    ASSERT_FALSE(tree.trace.empty());
    EXPECT_NEAR(tree.trace[0].score, dense.trace[0].score, 1e-12);
    EXPECT_EQ(tree.match_of_feature, dense.match_of_feature);
    EXPECT_NEAR(tree.statistics.accepted_weight, dense.statistics.accepted_weight, 1e-6);
  }
}

}  // namespace
}  // namespace active_matching_slam
