#include "active_matching_slam/evaluation/reliability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "active_matching_slam/evaluation/simulated_problem.h"
#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/matching/matcher.h"

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

int wrongMatches(const SimulatedProblem& problem, const PointListSearch& search,
                 const std::vector<int>& matches) {
  int wrong = 0;
  for (int f = 0; f < problem.prior.size(); ++f) {
    const int match = matches[static_cast<std::size_t>(f)];
    wrong += match >= 0 && search.matches(f)[static_cast<std::size_t>(match)].id !=
                               problem.true_point[static_cast<std::size_t>(f)];
  }
  return wrong;
}

struct Score {
  int right = 0;
  int clean = 0;  ///< without a wrong match
  double pixels = 0.0;
};

MatchOptions boundedMixture() {
  MatchOptions options;
  options.max_gaussians = 64;
  return options;
}

Score scoreOf(const std::string& matcher, const SimulatedProblemOptions& options, int frames,
              const MatchOptions& match_options = boundedMixture()) {
  ProblemSimulator simulator(options, 11);
  Score score;
  for (int n = 0; n < frames; ++n) {
    const SimulatedProblem problem = simulator.next();
    PointListSearch search = problem.search();
    const MatchResult result = createMatcher(matcher)->match(problem.prior, search, match_options);
    score.right += isEntirelyRight(problem, search, result.match_of_feature);
    score.clean += wrongMatches(problem, search, result.match_of_feature) == 0;
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
  options.repeated_fraction = 0.5;
  EXPECT_GT(scoreOf("active", options, 500).right, scoreOf("jcbb", options, 500).right);
}

/// A board on which every corner has its like in all directions, seen by a hasty camera.
SimulatedProblemOptions boardOfLikes() {
  SimulatedProblemOptions options;
  options.features = 40;
  options.repeated_fraction = 1.0;
  options.true_positive = 0.97;
  options.noise_sigma_px = 0.5;
  options.map_sigma_m = 0.001;
  options.acceleration = options.angular_acceleration = 12.0;
  return options;
}

TEST(ActiveMatching, IsMisledLessOftenThanJcbbAndRansacWhereEverythingRepeats) {
  const int frames = 100, jcbb = scoreOf("jcbb", boardOfLikes(), frames).clean,
            ransac = scoreOf("one_point_ransac", boardOfLikes(), frames).clean;
  for (const char* matcher : {"active", "fast_active", "chow_liu"}) {
    const int clean = scoreOf(matcher, boardOfLikes(), frames).clean;
    EXPECT_GT(clean, jcbb) << matcher;
    EXPECT_GT(clean, ransac) << matcher;
  }
  EXPECT_GE(scoreOf("active", boardOfLikes(), frames).clean, 90);
}

TEST(ActiveMatching, IsMisledLessOftenWithDeferredPruning) {
  MatchOptions does_not = boundedMixture();
  does_not.deferred_pruning_weight = 0.0;
  EXPECT_GT(scoreOf("active", boardOfLikes(), 200).clean,
            scoreOf("active", boardOfLikes(), 200, does_not).clean);
}

TEST(ActiveMatching, IsMisledLessOftenWithKBestAlternatives) {
  MatchOptions asks = boundedMixture(), does_not = asks;
  asks.deferred_pruning_weight = does_not.deferred_pruning_weight = 0.0;
  does_not.k_best = 0;
  EXPECT_GT(scoreOf("active", boardOfLikes(), 200, asks).clean,
            scoreOf("active", boardOfLikes(), 200, does_not).clean);
}

/// Whether what is claimed is what happens, in every bin of weights and in all frames together.
void expectProbabilities(const std::string& matcher, int frames, const MatchOptions& options) {
  const auto bins = measureReliability(matcher, frames, 10, 20, options).bins();
  double claimed = 0.0, right = 0.0, variance = 0.0;
  for (const ReliabilityBin& bin : bins) {
    claimed += bin.frames * bin.mean_weight;
    right += bin.frames * bin.fraction_correct;
    variance += std::pow(bin.frames * bin.sigma, 2);
    if (bin.frames < 10) continue;
    EXPECT_NEAR(bin.mean_weight, bin.fraction_correct, 3.0 * bin.sigma)
        << matcher << ", " << bin.frames << " frames";
  }
  EXPECT_NEAR(claimed, right, 3.0 * std::sqrt(variance)) << matcher;
  EXPECT_GT(bins.back().frames, frames / 2);
  EXPECT_LT(bins.back().frames, 0.95 * frames) << "too easy to discriminate";
}

TEST(MixtureMatching, WeightOfTheAcceptedHypothesisIsAProbability) {
  for (const char* matcher : {"active", "fast_active", "chow_liu"})
    expectProbabilities(matcher, 4000, {});
}

TEST(MixtureMatching, WeightIsAProbabilityHoweverMuchIsDroppedOrLatched) {
  MatchOptions options;
  options.prune_weight = 0.02;
  expectProbabilities("active", 4000, options);
  options = {};
  options.max_gaussians = 5;
  options.latch_information_bits = 0.1;
  expectProbabilities("active", 4000, options);
}

TEST(ChowLiuMatching, EqualsActiveMatchingOnTheCovarianceOfTheTree) {
  SimulatedProblemOptions options;
  options.features = 15;
  options.false_positive = 1e-4;
  ProblemSimulator simulator(options, 5);
  MatchOptions match_options;
  match_options.keep_trace = true;
  match_options.joint_rescoring = false;  // which knows the whole covariance
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
