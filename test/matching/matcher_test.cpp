#include "active_matching_slam/matching/matcher.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "active_matching_slam/evaluation/simulated_problem.h"

namespace active_matching_slam {
namespace {

SimulatedProblem problemOf(int features, double clutter = 1e-4, std::uint64_t seed = 3) {
  SimulatedProblemOptions options;
  options.features = features;
  options.false_positive = clutter;
  return ProblemSimulator(options, seed).next();
}

MatchResult matchWith(const std::string& name, const SimulatedProblem& problem,
                      const MatchOptions& options = {}) {
  PointListSearch search = problem.search();
  return createMatcher(name)->match(problem.prior, search, options);
}

class EveryMatcher : public testing::TestWithParam<std::string> {};

TEST_P(EveryMatcher, KeepsItsName) { EXPECT_EQ(GetParam(), createMatcher(GetParam())->name()); }

TEST_P(EveryMatcher, MatchesNothingOfNothing) {
  const MatchResult result = matchWith(GetParam(), problemOf(0));
  EXPECT_TRUE(result.match_of_feature.empty());
  EXPECT_EQ(0, result.statistics.searches);
}

TEST_P(EveryMatcher, FindsFewFeaturesThatAnswerAlone) {
  for (const int size : {1, 2, 3}) {
    SimulatedProblem problem = problemOf(size, 1e-9);
    for (int f = 0; f < size; ++f)
      problem.points[static_cast<std::size_t>(f)] = {problem.prior.mean(f) +
                                                     Eigen::Vector2d(0.5, -0.5)};
    problem.scores.clear();
    const MatchResult result = matchWith(GetParam(), problem);
    EXPECT_EQ(std::vector<int>(static_cast<std::size_t>(size), 0), result.match_of_feature);
    EXPECT_EQ(size, result.statistics.matched);
  }
}

TEST_P(EveryMatcher, GivesTheSameAnswerTwice) {
  const SimulatedProblem problem = problemOf(15);
  const MatchResult first = matchWith(GetParam(), problem), again = matchWith(GetParam(), problem);
  EXPECT_EQ(first.match_of_feature, again.match_of_feature);
  EXPECT_EQ(first.statistics.pixels_searched, again.statistics.pixels_searched);
  ASSERT_EQ(first.hypotheses.size(), again.hypotheses.size());
  for (std::size_t k = 0; k < first.hypotheses.size(); ++k)
    EXPECT_EQ(first.hypotheses[k].probability, again.hypotheses[k].probability);
}

TEST_P(EveryMatcher, LeavesImproperFeaturesOut) {
  SimulatedProblem problem = problemOf(8, 1e-6);
  problem.prior.z(0) = std::numeric_limits<double>::quiet_NaN();
  problem.prior.S.block<2, 2>(2, 2).setZero();
  problem.prior.S(4, 10) = problem.prior.S(10, 4) = std::numeric_limits<double>::infinity();
  const MatchResult result = matchWith(GetParam(), problem);
  EXPECT_EQ(-1, result.match_of_feature[0]);
  EXPECT_EQ(-1, result.match_of_feature[1]);
  EXPECT_EQ(-1, result.match_of_feature[2]);
  EXPECT_GE(result.statistics.degenerate_features, 3);
  EXPECT_GT(result.statistics.matched, 0);
}

TEST_P(EveryMatcher, SurvivesIdenticalFeaturesWithoutNoise) {
  SimulatedProblem problem = problemOf(6, 1e-6);
  // 3 is a copy of 2, and nothing is left between them.
  problem.prior.z.segment<2>(6) = problem.prior.z.segment<2>(4);
  problem.prior.S.middleRows<2>(6) = problem.prior.S.middleRows<2>(4).eval();
  problem.prior.S.middleCols<2>(6) = problem.prior.S.middleCols<2>(4).eval();
  problem.points[3] = problem.points[2];
  problem.scores[3] = problem.scores[2];
  const MatchResult result = matchWith(GetParam(), problem);
  EXPECT_EQ(6u, result.match_of_feature.size());
  EXPECT_GT(result.statistics.matched, 0);
}

TEST_P(EveryMatcher, FindsNothingOutsideTheImage) {
  const SimulatedProblem problem = problemOf(5);
  PixelBox elsewhere;
  elsewhere.min_u = elsewhere.min_v = 5000, elsewhere.max_u = elsewhere.max_v = 6000;
  PointListSearch search(problem.points, problem.scores, elsewhere);
  const MatchResult result = createMatcher(GetParam())->match(problem.prior, search, {});
  EXPECT_EQ(0, result.statistics.matched);
  EXPECT_EQ(0, result.statistics.pixels_searched);
  EXPECT_EQ(0, result.statistics.pixels_full_gates);
}

TEST_P(EveryMatcher, SearchesOnlyInsideTheImage) {
  const SimulatedProblem problem = problemOf(12);
  PixelBox image;
  image.min_u = 100, image.max_u = 500, image.min_v = 100, image.max_v = 300;
  PointListSearch search(problem.points, problem.scores, image);
  createMatcher(GetParam())->match(problem.prior, search, {});
  for (int f = 0; f < 12; ++f)
    search.searchedPixels(f).forEachRun([&](const PixelRun& run) {
      EXPECT_GE(run.v, image.min_v);
      EXPECT_LE(run.v, image.max_v);
      EXPECT_GE(run.begin_u, image.min_u);
      EXPECT_LE(run.end_u - 1, image.max_u);
    });
}

TEST_P(EveryMatcher, BoundsItsWorkAmongThousandsOfSpuriousMatches) {
  const SimulatedProblem problem = problemOf(10, 0.2);
  MatchOptions options;
  options.max_gaussians = 16;
  options.max_pixels = 20000;
  options.jcbb_max_nodes = 20000;
  const MatchResult result = matchWith(GetParam(), problem, options);
  EXPECT_GT(result.statistics.matches_met, 300);
  EXPECT_LE(result.hypotheses.size(), 16u);
  EXPECT_LT(result.statistics.nodes, 40000);
  // The statistics say so where a bound ended the work early.
  const std::string& ran = result.statistics.matcher;
  if (ran != "active_search" && ran != "one_point_ransac") {
    EXPECT_TRUE(result.statistics.cut_short);
  }
}

TEST_P(EveryMatcher, StopsAtTheBudgetOfPixels) {
  const SimulatedProblem problem = problemOf(30);
  MatchOptions options;
  options.max_pixels = 3000;
  const MatchStatistics cut = matchWith(GetParam(), problem, options).statistics;
  EXPECT_TRUE(cut.cut_short);
  EXPECT_GE(cut.pixels_searched, 2000);
  EXPECT_LT(cut.pixels_searched, cut.pixels_full_gates);
  EXPECT_GT(cut.matched, 0);
}

TEST_P(EveryMatcher, StopsAtTheBudgetOfTime) {
  const SimulatedProblem problem = problemOf(30);
  MatchOptions options;
  double now = 0.0;
  options.clock_s = [&now] { return now += 1e-4; };
  options.max_milliseconds = 5.0;
  const MatchResult result = matchWith(GetParam(), problem, options);
  EXPECT_TRUE(result.statistics.cut_short);
  EXPECT_LT(result.statistics.total_ms, 7.0);
  EXPECT_GT(result.statistics.matched, 0);
}

TEST_P(EveryMatcher, StopsAtTheModelledBudgetAtTheSamePlaceWhateverTheClockSays) {
  const SimulatedProblem problem = problemOf(30);
  MatchOptions options;
  options.modelled_time = true;
  const MatchStatistics whole = matchWith(GetParam(), problem, options).statistics;
  ASSERT_GT(whole.budget_ms, 0.0);
  options.max_milliseconds = 0.5 * whole.budget_ms;
  std::vector<MatchResult> results;
  for (const double tick_s : {0.0, 1.0}) {
    double now = 0.0;
    options.clock_s = [&now, tick_s] { return now += tick_s; };
    results.push_back(matchWith(GetParam(), problem, options));
    const MatchStatistics& cut = results.back().statistics;
    EXPECT_TRUE(cut.cut_short) << tick_s;
    EXPECT_LT(cut.budget_ms, whole.budget_ms) << tick_s;
    EXPECT_GT(cut.matched, 0) << tick_s;
  }
  EXPECT_EQ(results[0].match_of_feature, results[1].match_of_feature);
  EXPECT_EQ(results[0].statistics.budget_ms, results[1].statistics.budget_ms);
}

INSTANTIATE_TEST_SUITE_P(Names, EveryMatcher, testing::ValuesIn(matcherNames()));

class MixtureMatcher : public testing::TestWithParam<std::string> {};

TEST_P(MixtureMatcher, StopsAtTheBudgetOfPixelsWithinOneSearch) {
  const SimulatedProblem problem = problemOf(30);
  MatchOptions options;
  options.keep_trace = true;
  options.max_pixels = 3000;
  const MatchResult result = matchWith(GetParam(), problem, options);
  EXPECT_TRUE(result.statistics.cut_short);
  ASSERT_FALSE(result.trace.empty());
  EXPECT_LT(result.statistics.pixels_searched - result.trace.back().pixels_new, 3000);
}

TEST_P(MixtureMatcher, KeepsTheMixtureUnderItsCap) {
  const SimulatedProblem problem = problemOf(12, 1e-3);
  MatchOptions options;
  options.max_gaussians = 5;
  options.keep_trace = true;
  const MatchResult result = matchWith(GetParam(), problem, options);
  for (const MatchStep& step : result.trace) EXPECT_LE(step.pruned.size(), 5u);
  if (GetParam() == "active") {
    EXPECT_TRUE(result.statistics.cut_short);
  }
}

/// Ten features that know little of each other; the even ones answer twice, 2 px apart.
SimulatedProblem twinsAmongFeatures() {
  SimulatedProblem problem = problemOf(10, 1e-9);
  Eigen::MatrixXd& S = problem.prior.S;
  S.setIdentity();
  S *= 8.0;
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 10; ++j) S.block<2, 2>(2 * i, 2 * j) += 0.5 * Eigen::Matrix2d::Identity();
  for (int f = 0; f < 10; ++f) {
    auto& points = problem.points[static_cast<std::size_t>(f)];
    points = {problem.prior.mean(f)};
    if (f % 2 == 0)
      points = {problem.prior.mean(f) + Eigen::Vector2d(1.0, 0.0),
                problem.prior.mean(f) - Eigen::Vector2d(1.0, 0.0)};
  }
  problem.scores.clear();
  return problem;
}

TEST_P(MixtureMatcher, TwinMatchesThatConcernNoOtherFeatureMakeNoGaussians) {
  if (GetParam() == "fast_active") GTEST_SKIP() << "takes the nearest once a Gaussian dominates";
  const SimulatedProblem problem = twinsAmongFeatures();
  const MatchResult all = matchWith(GetParam(), problem);
  EXPECT_GE(all.hypotheses.size(), 32u);
  EXPECT_LT(all.statistics.accepted_weight, 0.04);

  MatchOptions options;
  options.merge_sigmas = 0.5;
  const MatchResult merged = matchWith(GetParam(), problem, options);
  EXPECT_LE(merged.statistics.max_gaussians, 4);
  EXPECT_GT(merged.statistics.accepted_weight, 0.9);
  for (int f = 0; f < 10; ++f)
    EXPECT_EQ(f % 2 == 0 ? -1 : 0, merged.match_of_feature[static_cast<std::size_t>(f)]) << f;
}

TEST_P(MixtureMatcher, TheBetterOfTwinMatchesIsTaken) {
  if (GetParam() == "fast_active") GTEST_SKIP() << "takes the nearest once a Gaussian dominates";
  SimulatedProblem problem = twinsAmongFeatures();
  for (const auto& points : problem.points) {
    problem.scores.emplace_back(points.size(), 0.95);
    problem.scores.back().front() = points.size() == 1 ? 0.95 : 0.8;
  }
  MatchOptions options;
  options.merge_sigmas = 0.5;
  const MatchResult merged = matchWith(GetParam(), problem, options);
  EXPECT_GT(merged.statistics.accepted_weight, 0.9);
  for (int f = 0; f < 10; ++f)
    EXPECT_EQ(f % 2 == 0 ? 1 : 0, merged.match_of_feature[static_cast<std::size_t>(f)]) << f;
}

TEST_P(MixtureMatcher, FusesWhatStrongHypothesesShareWhenAmbiguous) {
  // The last feature answers twice, at equal distances from where it is expected.
  SimulatedProblem problem = problemOf(4, 1e-9);
  for (int f = 0; f < 4; ++f) problem.points[static_cast<std::size_t>(f)] = {problem.prior.mean(f)};
  const Eigen::Vector2d off(1.5, 0.0);
  problem.points[3] = {problem.prior.mean(3) + off, problem.prior.mean(3) - off};
  problem.scores.clear();
  MatchOptions options;
  options.fast_accept_weight = 1.0;
  options.ambiguous_below_weight = 0.9;
  const MatchResult result = matchWith(GetParam(), problem, options);
  EXPECT_TRUE(result.statistics.ambiguous);
  EXPECT_EQ((std::vector<int>{0, 0, 0, -1}), result.match_of_feature);
  EXPECT_GE(result.hypotheses.front().match_of_feature[3], 0);
  EXPECT_NEAR(0.5, result.statistics.accepted_weight, 0.02);
}

TEST_P(MixtureMatcher, ProbabilitiesSumToOneWithWhatWasDroppedAndComeHighestFirst) {
  const MatchResult result = matchWith(GetParam(), problemOf(20, 3e-4));
  double sum = 0.0, last = 1.0;
  for (const MatchHypothesis& h : result.hypotheses) {
    EXPECT_LE(h.probability, last);
    last = h.probability;
    sum += h.probability;
  }
  EXPECT_NEAR(1.0, sum + result.statistics.dropped_probability, 1e-9);
  EXPECT_EQ(result.hypotheses.front().probability, result.statistics.accepted_weight);
  EXPECT_LT(result.statistics.information_bits_end, result.statistics.information_bits_start);
}

INSTANTIATE_TEST_SUITE_P(Names, MixtureMatcher,
                         testing::Values("active", "fast_active", "chow_liu", "auto"));

TEST(ActiveMatcher, AfterTheLatchEvaluatesNothingAndLosesNoMatch) {
  int steps = 0, latched_steps = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SimulatedProblem problem = problemOf(20, 2e-5, seed);
    MatchOptions options;
    options.keep_trace = true;
    const MatchResult full = matchWith("active", problem, options);
    options.latch_information_bits = 0.1;
    const MatchResult latched = matchWith("active", problem, options);
    EXPECT_GE(latched.statistics.matched, full.statistics.matched - 1);
    steps += static_cast<int>(full.trace.size());
    latched_steps += static_cast<int>(latched.trace.size());
    bool evaluated = true;
    for (const MatchStep& step : latched.trace) {
      EXPECT_TRUE(evaluated || !step.evaluated);
      evaluated = step.evaluated;
    }
  }
  EXPECT_LE(latched_steps, steps);
}

TEST(AutoMatcher, TakesActiveForFewFeaturesWhateverTheClutter) {
  // The tree would cost as much there, and be wrong more often.
  MatchOptions options;
  options.max_gaussians = 16;
  options.max_pixels = 20000;
  EXPECT_EQ("active", matchWith("auto", problemOf(60, 1e-2), options).statistics.matcher);
}

TEST(AutoMatcher, TakesActiveForFewFeaturesAndChowLiuForMany) {
  EXPECT_EQ("active", matchWith("auto", problemOf(11)).statistics.matcher);
  MatchOptions options;
  options.latch_information_bits = 0.1;
  options.max_gaussians = 16;
  EXPECT_EQ("chow_liu", matchWith("auto", problemOf(300, 1e-6), options).statistics.matcher);
}

TEST(Jcbb, MarksASearchThatRanOutOfNodes) {
  MatchOptions options;
  options.jcbb_max_nodes = 50;
  const MatchResult result = matchWith("jcbb", problemOf(25, 5e-4), options);
  EXPECT_TRUE(result.statistics.cut_short);
  EXPECT_GT(result.statistics.matched, 0);
}

TEST(CreateMatcher, RefusesAnUnknownNameAndListsTheKnownOnes) {
  try {
    createMatcher("magic");
    FAIL() << "an unknown name was accepted";
  } catch (const std::invalid_argument& error) {
    for (const std::string& name : matcherNames())
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos);
  }
}

TEST(UpdateRules, HaveNamesAndNoOthers) {
  for (const UpdateRule rule : {UpdateRule::kIncremental, UpdateRule::kThesis})
    EXPECT_EQ(updateRuleFromName(updateRuleName(rule)), rule);
  EXPECT_THROW(updateRuleFromName("mine"), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
