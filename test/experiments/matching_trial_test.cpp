#include "../../src/experiments/matching_trial.h"

#include <gtest/gtest.h>

#include "active_matching_slam/evaluation/simulated_problem.h"

namespace active_matching_slam {
namespace {

RecordedProblem problemOf(int features) {
  SimulatedProblemOptions options;
  options.features = features;
  const SimulatedProblem simulated = ProblemSimulator(options, 1).next();
  RecordedProblem problem;
  problem.prior = simulated.prior;
  problem.templates.resize(static_cast<std::size_t>(features));
  for (const Eigen::Vector2d& pixel : simulated.true_pixel) problem.reference_px.push_back(pixel);
  return problem;
}

TEST(MatchingTrial, ASelectionKeepsTheMarginalsOfWhatItKeeps) {
  const RecordedProblem all = problemOf(7);
  const RecordedProblem part = selectFeatures(all, {1, 4, 6});
  ASSERT_EQ(part.prior.size(), 3);
  EXPECT_EQ(part.prior.ids[1], all.prior.ids[4]);
  EXPECT_EQ(part.prior.mean(2), all.prior.mean(6));
  EXPECT_EQ((part.prior.S.block<2, 2>(0, 2)), (all.prior.S.block<2, 2>(2, 8)));
  EXPECT_EQ(part.reference_px[0], all.reference_px[1]);
}

TEST(MatchingTrial, SpreadTakesSoManyFromFirstToLast) {
  const RecordedProblem all = problemOf(10);
  EXPECT_EQ(spreadFeatures(all, 30).prior.size(), 10);
  const RecordedProblem part = spreadFeatures(all, 5);
  EXPECT_EQ(part.prior.ids,
            (std::vector<FeatureId>{all.prior.ids[0], all.prior.ids[2], all.prior.ids[4],
                                    all.prior.ids[6], all.prior.ids[8]}));
}

TEST(MatchingTrial, AssociationsDifferByPlaceOrByLack) {
  MatchingTrial a, b;
  a.accepted_px = b.accepted_px = {{1.0, 2.0}, unknownPixel()};
  EXPECT_TRUE(sameAssociations(a, b));
  b.accepted_px[0].x() += 3.0;
  EXPECT_FALSE(sameAssociations(a, b));
  b.accepted_px = {{1.0, 2.0}, {5.0, 5.0}};
  EXPECT_FALSE(sameAssociations(a, b));
}

TEST(MatchingTrial, SummariesAreMeansOfTheFrames) {
  std::vector<MatchingTrial> trials(2);
  for (MatchingTrial& trial : trials) trial.accepted_px = {unknownPixel()};
  trials[0].result.statistics.pixels_searched = 100;
  trials[1].result.statistics.pixels_searched = 300;
  trials[1].result.statistics.max_gaussians = 4;
  trials[1].error_px = {1.0, 2.0};
  trials[1].right = 2;
  const std::vector<RecordedProblem> problems(2);
  const TrialSummary summary = summariseTrials(trials, trials, problems);
  EXPECT_EQ(summary.frames, 2);
  EXPECT_EQ(summary.pixels, 200.0);
  EXPECT_EQ(summary.most_gaussians, 4);
  EXPECT_EQ(summary.right, 1.0);
  EXPECT_EQ(summary.error_px, 1.5);
  EXPECT_EQ(summary.same_as_jcbb, 2);
}

TEST(MatchingTrial, AllSixMatchersTakePart) {
  for (const std::string& name : matcherNames()) {
    if (name == "auto") continue;
    EXPECT_NO_THROW(matcherVariant(name)) << name;
  }
  EXPECT_THROW(matcherVariant("potato"), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
