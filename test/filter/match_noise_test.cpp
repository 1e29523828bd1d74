#include "active_matching_slam/filter/match_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace active_matching_slam {
namespace {

const Eigen::Vector2d not_a_number(std::numeric_limits<double>::quiet_NaN(), 0.0);

std::vector<Eigen::Vector2d> gaussian(double sigma, std::size_t count, std::mt19937* generator) {
  std::normal_distribution<double> normal(0.0, sigma);
  std::vector<Eigen::Vector2d> values;
  while (values.size() < count) {
    const double x = normal(*generator);
    values.emplace_back(x, normal(*generator));
  }
  return values;
}

/// After many updates whose residuals are of this standard deviation, a few of them far off.
double learntFrom(double sigma, double share_far_off, const FilterOptions& options) {
  std::mt19937 generator(1);
  MatchNoise noise;
  for (int k = 0; k < 2000; ++k) {
    std::vector<Eigen::Vector2d> residuals = gaussian(sigma, 50, &generator);
    for (std::size_t i = 0; i < 50 * share_far_off; ++i) residuals[i].setConstant(5.0);
    noise.learn(residuals);
  }
  return noise.sigma_px(options);
}

TEST(MatchNoise, IsWhatUpdatesLeaveWhateverAFewMatchesSay) {
  FilterOptions options;
  options.minimum_sigma_px = 0.01;
  const double learnt = learntFrom(0.04, 0.0, options);
  EXPECT_GT(learnt, 0.7 * 0.04);
  EXPECT_LT(learnt, 0.04) << "tails are told apart";
  EXPECT_NEAR(learntFrom(0.06, 0.0, options), 1.5 * learnt, 0.05 * learnt);
  EXPECT_NEAR(learntFrom(0.04, 0.1, options), learnt, 0.2 * learnt);
}

TEST(MatchNoise, FollowsTheBlurOfAnImageAtOnceAndForgetsItWithTheNext) {
  const FilterOptions options;
  MatchNoise noise;
  std::mt19937 generator(1);
  const auto image = [&](double seen_px, double shown_px) {
    noise.see(std::vector<double>(20, seen_px));
    const double before_update = noise.sigma_px(options);
    noise.learn(gaussian(shown_px, 50, &generator));
    return before_update;
  };
  for (int k = 0; k < 200; ++k) image(0.03, 0.04);
  const double sharp = image(0.03, 0.04);
  EXPECT_EQ(noise.ofImage(), 1.0);
  const double blurred = image(0.09, 0.18);  // matches suffer more than the templates' likeness
  EXPECT_GT(blurred, 4.2 * sharp);
  EXPECT_LT(blurred, 5.2 * sharp);
  image(0.09, 0.18);
  EXPECT_NEAR(image(0.03, 0.04), sharp, 0.15 * sharp);
  noise.see({0.09, 0.09});  // too few: like most
  EXPECT_EQ(noise.ofImage(), 1.0);
  image(1.0, 0.04);  // however little such an image has of the templates
  EXPECT_LE(noise.ofImage(), 5.0);
}

TEST(MatchNoise, OfAFeatureGrowsWithWhatIsLeftBetweenItsImagesAndItsTemplate) {
  const FilterOptions options;
  MatchNoise noise;
  std::mt19937 generator(1);
  for (int k = 0; k < 200; ++k) noise.learn(gaussian(0.04, 50, &generator));
  FeatureNoise usual, worse, better, unknown;
  for (int k = 0; k < 100; ++k) {
    noise.see(std::vector<double>(20, 0.05));
    usual.see(0.05);
    worse.see(0.1);
    better.see(0.03);
    unknown.see(0.0);
  }
  EXPECT_NEAR(worse.seen_px(), 0.1, 1e-9);
  EXPECT_NEAR(noise.likeMost(usual), 1.0, 1e-9);
  EXPECT_EQ(noise.likeMost(unknown), 1.0);
  EXPECT_GT(noise.likeMost(worse), 2.0);
  EXPECT_LT(noise.likeMost(better), 0.6);
  EXPECT_NEAR(noise.sigma_px(options, worse), noise.likeMost(worse) * noise.sigma_px(options),
              1e-9);
  EXPECT_LT(noise.sigma_px(options, better), noise.sigma_px(options));
  EXPECT_GE(noise.sigma_px(options, better), options.minimum_sigma_px);
  for (int k = 0; k < 100; ++k) worse.see(0.05);  // it is seen well again
  EXPECT_NEAR(noise.likeMost(worse), 1.0, 0.05);
}

TEST(MatchNoise, StaysBetweenItsBounds) {
  FilterOptions options;
  EXPECT_EQ(learntFrom(1.0, 0.0, options), options.sigma_px);
  EXPECT_NEAR(learntFrom(1e-5, 0.0, options), options.minimum_sigma_px, 1e-6);
  options.minimum_sigma_px = 1.0;  // above sigma_px: nothing is learnt
  EXPECT_EQ(learntFrom(0.1, 0.0, options), options.sigma_px);
}

TEST(MatchNoise, IsKnownFromTheFirstUpdatesAndFollowsTheNext) {
  const FilterOptions options;
  MatchNoise noise;
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
  std::mt19937 generator(1);
  for (int k = 0; k < 10; ++k) noise.learn(gaussian(0.05, 50, &generator));
  EXPECT_NEAR(noise.sigma_px(options), learntFrom(0.05, 0.0, options), 0.01);
  const double before = noise.sigma_px(options);
  noise.learn(gaussian(0.1, 50, &generator));
  EXPECT_GT(noise.sigma_px(options), 1.4 * before);
  EXPECT_LT(noise.sigma_px(options), 2.0 * before);
  noise.reset();
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
}

TEST(MatchNoise, TooLittleOrWhatIsNotANumberTellsNothing) {
  const FilterOptions options;
  MatchNoise noise;
  for (int k = 0; k < 2000; ++k) {
    EXPECT_EQ(noise.learn({}), 0.0);
    EXPECT_EQ(noise.learn(std::vector<Eigen::Vector2d>(7, Eigen::Vector2d::Zero())), 0.0);
    EXPECT_EQ(noise.learn(std::vector<Eigen::Vector2d>(20, not_a_number)), 0.0);
  }
  EXPECT_EQ(noise.sigma_px(options), options.sigma_px);
}

TEST(MatchNoise, TellsWhatAFrameShows) {
  std::mt19937 generator(1);
  MatchNoise noise;
  EXPECT_NEAR(noise.learn(gaussian(0.05, 4000, &generator)), 0.05, 0.002);
}

TEST(MatchNoise, ErrorsLastTheLongerTheLessTheImageMoves) {
  MatchNoise noise;
  const FeatureNoise feature;
  EXPECT_EQ(noise.repetitions(feature), 1.0);
  noise.seeMotion(std::vector<double>(20, 200.0));
  EXPECT_EQ(noise.repetitions(feature), 1.0);
  noise.seeMotion(std::vector<double>(20, 1.6));
  const double moving = noise.repetitions(feature);
  EXPECT_GT(moving, 1.5);
  noise.seeMotion(std::vector<double>(20, 0.4));
  const double slow = noise.repetitions(feature);
  EXPECT_GT(slow, 2.0 * moving);
  noise.seeMotion(std::vector<double>(20, 0.0));  // not for ever
  EXPECT_GT(noise.repetitions(feature), slow);
  EXPECT_LT(noise.repetitions(feature), 2.0 * slow);
  noise.seeMotion({0.0, 0.0});  // too few
  EXPECT_EQ(noise.repetitions(feature), 1.0);
}

FeatureNoise learntFeature(double sigma, int matches, double shown_px) {
  std::mt19937 generator(2);
  FeatureNoise noise;
  for (const Eigen::Vector2d& residual : gaussian(sigma, matches, &generator))
    noise.learn(residual, shown_px);
  return noise;
}

TEST(FeatureNoise, IsLikeThatOfOthersUntilThereIsEnoughToTell) {
  EXPECT_EQ(FeatureNoise().factor(), 1.0);
  const double first = learntFeature(0.15, 3, 0.05).factor();
  EXPECT_GT(first, 1.0);
  EXPECT_LT(first, 2.0);
}

TEST(FeatureNoise, IsLearntInTheUnitOfWhatFramesShow) {
  EXPECT_NEAR(learntFeature(0.15, 500, 0.05).factor(), 3.0, 0.5);
  EXPECT_NEAR(learntFeature(0.05, 500, 0.05).factor(), 1.0, 0.1);
  EXPECT_LT(learntFeature(0.01, 500, 0.05).factor(), 0.6);
}

TEST(FeatureNoise, FollowsAFeatureThatChanges) {
  FeatureNoise noise = learntFeature(0.2, 500, 0.05);
  const double before = noise.factor();
  std::mt19937 generator(3);
  for (const Eigen::Vector2d& residual : gaussian(0.05, 500, &generator))
    noise.learn(residual, 0.05);
  EXPECT_LT(noise.factor(), 0.5 * before);
}

TEST(FeatureNoise, OneMatchFarOffDoesNotRuinAFeatureAndWhatIsNoNumberTellsNothing) {
  FeatureNoise noise = learntFeature(0.05, 500, 0.05);
  const double before = noise.factor();
  noise.learn(not_a_number, 0.05);
  EXPECT_EQ(noise.factor(), before);
  noise.learn(Eigen::Vector2d(1e6, 0.0), 0.05);
  EXPECT_LT(noise.factor(), 2.0 * before);
}

/// Errors of unit variance per axis, of which that share goes on from match to match (an
/// autoregression of first order) and the rest is anew.
FeatureNoise featureThatErrsForLong(double lasting_share, int matches, unsigned seed) {
  constexpr double kGoesOn = 0.95;
  std::mt19937 generator(seed);
  const auto lasts =
      gaussian(std::sqrt(lasting_share * (1.0 - kGoesOn * kGoesOn)), matches, &generator);
  const auto anew = gaussian(std::sqrt(1.0 - lasting_share), matches, &generator);
  FeatureNoise noise;
  Eigen::Vector2d lasting = Eigen::Vector2d::Zero();
  for (int k = 0; k < matches; ++k) {
    lasting = kGoesOn * lasting + lasts[k];
    noise.learn(lasting + anew[k], 1.0);
  }
  return noise;
}

double lastingOnAverage(double lasting_share) {
  double sum = 0.0;
  for (unsigned seed = 0; seed < 50; ++seed)
    sum += featureThatErrsForLong(lasting_share, 600, seed).lasting().value() / 50.0;
  return sum;
}

TEST(FeatureNoise, TellsErrorsThatLastFromSuchThatAreAnew) {
  EXPECT_NEAR(lastingOnAverage(0.0), 1.0, 0.1);
  // The variance of the average of independent errors is w / (2 - w) for the weight w = 1/8 of the
  // newest, of those that go on by a that times (1 + (1 - w) a) / (1 - (1 - w) a).
  const double longer = (1.0 + 0.875 * 0.95) / (1.0 - 0.875 * 0.95);
  EXPECT_NEAR(lastingOnAverage(1.0), longer, 0.15 * longer);
  EXPECT_NEAR(lastingOnAverage(0.5), 0.5 + 0.5 * longer, 0.08 * longer);
}

TEST(FeatureNoise, WhatLastsIsThatOfMostUntilThereIsEnoughToTell) {
  FeatureNoise noise;
  EXPECT_FALSE(noise.lasting());
  EXPECT_EQ(noise.lastingLikeMost(4.0), 1.0);
  noise.learn(Eigen::Vector2d(3.0, 3.0), 1.0);
  EXPECT_FALSE(noise.lasting());
  EXPECT_GT(noise.lastingLikeMost(4.0), 1.0);
  EXPECT_LT(noise.lastingLikeMost(4.0), 1.1);
  noise.learn(not_a_number, 1.0);
  EXPECT_TRUE(std::isfinite(noise.lastingLikeMost(4.0)));
  noise.learn(Eigen::Vector2d(1e6, 0.0), 1.0);  // one that is far off does not ruin it
  EXPECT_LT(noise.lastingLikeMost(4.0), 3.0);
}

TEST(MatchNoise, AFeatureWhoseErrorsLastIsNoisierLastsLongerAndWandersMore) {
  const FilterOptions options;
  std::mt19937 generator(1);
  MatchNoise noise;
  for (int k = 0; k < 50; ++k) noise.learn(gaussian(0.05, 50, &generator));
  noise.seeMotion(std::vector<double>(20, 0.8));
  const FeatureNoise lasting = featureThatErrsForLong(0.9, 600, 1);
  const FeatureNoise anew = featureThatErrsForLong(0.0, 600, 1);
  EXPECT_EQ(noise.lastingLikeMost(lasting), 1.0) << "nothing is known of most";
  noise.learnLasting({lasting.lasting().value()});
  EXPECT_EQ(noise.lastingLikeMost(lasting), 1.0) << "one feature tells nothing of most";
  noise.learnLasting(std::vector<double>(20, 2.5));

  EXPECT_EQ(noise.lastingLikeMost(FeatureNoise()), 1.0);
  EXPECT_GT(noise.lastingLikeMost(lasting), 1.5);
  EXPECT_LT(noise.lastingLikeMost(anew), 0.8);
  const double most = noise.repetitions(FeatureNoise());
  EXPECT_GT(noise.repetitions(lasting), 1.1 * most);
  EXPECT_LT(noise.repetitions(anew), 0.9 * most);
  EXPECT_GE(noise.repetitions(anew), 1.0);
  EXPECT_GT(noise.sigma_px(options, lasting),
            1.1 * lasting.factor() * noise.sigma_px(options, FeatureNoise()));
  EXPECT_LT(noise.sigma_px(options, anew),
            0.9 * anew.factor() * noise.sigma_px(options, FeatureNoise()));
  EXPECT_GT(noise.wanderLikeMost(lasting), 1.2 * lasting.factor());
}

TEST(MatchNoise, OfAFeatureIsInProportionToItsOwnButNotBelowTheLeast) {
  FilterOptions options;
  options.sigma_px = 0.2;
  options.minimum_sigma_px = 0.01;
  std::mt19937 generator(1);
  MatchNoise noise;
  for (int k = 0; k < 500; ++k) noise.learn(gaussian(0.05, 50, &generator));
  const double most = noise.sigma_px(options);
  const FeatureNoise bad = learntFeature(0.5, 500, 0.05), good = learntFeature(0.01, 500, 0.05);
  EXPECT_EQ(noise.sigma_px(options, FeatureNoise()), most);
  EXPECT_DOUBLE_EQ(noise.sigma_px(options, bad), bad.factor() * most);
  EXPECT_GT(noise.sigma_px(options, bad), options.sigma_px);
  EXPECT_LT(noise.sigma_px(options, good), 0.6 * most);
  options.minimum_sigma_px = most;
  EXPECT_EQ(noise.sigma_px(options, good), most);
  options.minimum_sigma_px = 2.0 * options.sigma_px;  // nothing is trusted more than that
  EXPECT_EQ(noise.sigma_px(options, good), options.sigma_px);
}

TEST(MatchNoise, CornersWanderInProportionToTheirNoiseButNoneHardly) {
  const MatchNoise noise;
  const FeatureNoise bad = learntFeature(0.1, 500, 0.05), good = learntFeature(0.01, 500, 0.05);
  EXPECT_EQ(noise.wanderLikeMost(FeatureNoise()), 1.0);
  EXPECT_GT(bad.factor(), 1.5);
  EXPECT_EQ(noise.wanderLikeMost(bad), bad.factor());
  EXPECT_LT(good.factor(), 0.6);
  EXPECT_GT(noise.wanderLikeMost(good), 0.6);
}

}  // namespace
}  // namespace active_matching_slam
