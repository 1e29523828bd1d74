#include "active_matching_slam/filter/match_noise.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

namespace active_matching_slam {
namespace {

std::vector<double> gaussian(double sigma, std::size_t count, std::mt19937* generator) {
  std::normal_distribution<double> normal(0.0, sigma);
  std::vector<double> values;
  while (values.size() < count) values.push_back(normal(*generator));
  return values;
}

/// After many updates whose residuals are of this standard deviation, a few of them far off.
double learntFrom(double sigma, double share_far_off, const FilterOptions& options) {
  std::mt19937 generator(1);
  MatchNoise noise;
  for (int k = 0; k < 2000; ++k) {
    std::vector<double> residuals = gaussian(sigma, 100, &generator);
    for (std::size_t i = 0; i < 100 * share_far_off; ++i) residuals[i] = 5.0;
    noise.learn(options, residuals);
  }
  return noise.sigma_px(options);
}

TEST(MatchNoise, IsInProportionToWhatUpdatesLeaveWhateverAFewMatchesSay) {
  const FilterOptions options;
  const double learnt = learntFrom(0.04, 0.0, options);
  EXPECT_GT(learnt, 0.04);
  EXPECT_LT(learnt, options.sigma_px);
  EXPECT_NEAR(learntFrom(0.06, 0.0, options), 1.5 * learnt, 0.05 * learnt);
  EXPECT_NEAR(learntFrom(0.04, 0.1, options), learnt, 0.2 * learnt);
}

TEST(MatchNoise, StaysBetweenItsBounds) {
  FilterOptions options;
  EXPECT_EQ(learntFrom(1.0, 0.0, options), options.sigma_px);
  EXPECT_EQ(learntFrom(0.001, 0.0, options), options.minimum_sigma_px);
  options.minimum_sigma_px = 1.0;  // above sigma_px: nothing is learnt
  EXPECT_EQ(learntFrom(0.1, 0.0, options), options.sigma_px);
}

TEST(MatchNoise, IsNotLearntInAHurry) {
  FilterOptions options;
  MatchNoise noise;
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
  std::mt19937 generator(1);
  for (int k = 0; k < 10; ++k) noise.learn(options, gaussian(0.05, 100, &generator));
  EXPECT_LT(noise.sigma_px(options), options.sigma_px);
  EXPECT_GT(noise.sigma_px(options), 0.8 * options.sigma_px);
  noise.reset();
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
}

TEST(MatchNoise, TooLittleOrWhatIsNotANumberTellsNothing) {
  FilterOptions options;
  MatchNoise noise;
  for (int k = 0; k < 2000; ++k) {
    noise.learn(options, {});
    noise.learn(options, std::vector<double>(15, 0.0));
    noise.learn(options, std::vector<double>(20, std::numeric_limits<double>::quiet_NaN()));
  }
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
}

}  // namespace
}  // namespace active_matching_slam
