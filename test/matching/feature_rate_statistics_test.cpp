#include "active_matching_slam/matching/feature_rate_statistics.h"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

namespace active_matching_slam {
namespace {

TEST(FeatureRateStatistics, StartAtThePriorsMean) {
  FeatureRatePrior prior;
  prior.mean = {0.8, 3e-4};
  const FeatureRates rates = FeatureRateStatistics().rates(prior);
  EXPECT_DOUBLE_EQ(0.8, rates.true_positive);
  EXPECT_DOUBLE_EQ(3e-4, rates.false_positive);
}

TEST(FeatureRateStatistics, ConvergeToTheTruth) {
  std::mt19937 random(1);
  std::bernoulli_distribution found(0.65);
  std::poisson_distribution<int> clutter(800 * 2e-3);
  FeatureRateStatistics statistics;
  for (int n = 0; n < 4000; ++n) {
    const bool is_found = found(random);
    statistics.add(is_found, clutter(random) + (is_found ? 1 : 0), 800);
  }
  const FeatureRates rates = statistics.rates({});
  EXPECT_NEAR(0.65, rates.true_positive, 0.03);
  EXPECT_NEAR(2e-3, rates.false_positive, 2e-4);
}

TEST(FeatureRateStatistics, StayProperAfterOnlyOneKindOfOutcome) {
  FeatureRateStatistics always, never;
  for (int n = 0; n < 100000; ++n) {
    always.add(true, 1, 100);
    never.add(false, 50, 10);
  }
  EXPECT_LT(always.rates({}).true_positive, 1.0);
  EXPECT_GT(always.rates({}).false_positive, 0.0);
  EXPECT_GT(never.rates({}).true_positive, 0.0);
  EXPECT_LT(never.rates({}).false_positive, 1.0);
}

TEST(FeatureRateStatistics, RefuseAnImproperPrior) {
  FeatureRatePrior prior;
  prior.mean.true_positive = 1.0;
  EXPECT_THROW(FeatureRateStatistics().rates(prior), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
