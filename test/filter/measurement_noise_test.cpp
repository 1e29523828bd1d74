#include "active_matching_slam/filter/measurement_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace active_matching_slam {
namespace {

const std::vector<FitPrecision> typical_fits(40, FitPrecision{0.2});

/// Post-fit residuals of `landmark` per axis, over what its fit expects: first-order Gauss-Markov
/// of unit variance times `scale`, with the correlation `phi` from image to image.
void learnResiduals(double scale, double phi, int images, std::mt19937* random,
                    LandmarkNoise* landmark) {
  std::normal_distribution<double> normal;
  const auto draw = [&] {
    const double x = normal(*random);
    return Eigen::Vector2d(x, normal(*random));
  };
  Eigen::Vector2d residual = draw();
  for (int k = 0; k < images; ++k) {
    landmark->learn(std::sqrt(scale) * residual);
    residual = phi * residual + std::sqrt(1.0 - phi * phi) * draw();
  }
}

/// Images whose residuals have `scale` times the variance expected.
void learnImages(double scale, int images, MeasurementNoise* noise) {
  for (int k = 0; k < images; ++k) {
    noise->predict(1.0 / 30.0);
    noise->observeFits(typical_fits);
    const double expected = std::pow(noise->typicalSigma_px(), 2);
    noise->learn(scale / expected, 70.0);
  }
}

TEST(VarianceScale, IsTheMeanOfPriorAndSamplesByTheirDegrees) {
  VarianceScale scale(2.0, 30.0);
  scale.learn(10.0, 10.0);
  EXPECT_DOUBLE_EQ(scale.scale(), (30.0 * 2.0 + 10.0) / 40.0);
  EXPECT_DOUBLE_EQ(scale.degrees(), 40.0);
  scale.forget(0.5);
  EXPECT_DOUBLE_EQ(scale.degrees(), 20.0);
  scale.learn(20.0 * 5.0, 20.0);
  EXPECT_DOUBLE_EQ(scale.scale(), 0.5 * (1.75 + 5.0));
}

TEST(MeasurementNoise, BeforeAnyResidualIsWhatTheOptionsSay) {
  const FilterOptions options;
  const MeasurementNoise noise(options);
  EXPECT_EQ(noise.typicalSigma_px(), options.sigma_px);
  EXPECT_EQ(noise.gateSigma_px(), options.sigma_px);
  EXPECT_EQ(noise.sigma_px({0.05}, LandmarkNoise()), options.sigma_px);
  EXPECT_EQ(noise.degrees(), 0.0) << "the first residuals decide";
}

TEST(MeasurementNoise, ConvergesToTheVarianceOfTheResiduals) {
  for (const double sigma_px : {0.15, 0.4, 1.2}) {
    MeasurementNoise noise{FilterOptions()};
    learnImages(sigma_px * sigma_px, 60, &noise);
    EXPECT_NEAR(noise.typicalSigma_px(), sigma_px, 0.02 * sigma_px);
    const double bounded_px = std::min(sigma_px, FilterOptions().sigma_px);
    EXPECT_GT(noise.gateSigma_px(), bounded_px) << "whole pixels are searched";
    EXPECT_LT(noise.gateSigma_px(), bounded_px + 0.3) << "wrong matches do not widen gates";
    // By the fit of each match, to the first power.
    EXPECT_NEAR(noise.sigma_px({0.6}, LandmarkNoise()), 3.0 * sigma_px, 0.06 * sigma_px);
  }
}

TEST(MeasurementNoise, FollowsAnImageThatIsWorseWithinItsMemoryAndAtOnceByItsFits) {
  FilterOptions options;
  options.noise_memory_s = 0.1;
  MeasurementNoise noise(options);
  learnImages(0.04, 60, &noise);
  noise.observeFits(std::vector<FitPrecision>(40, FitPrecision{0.8}));  // blurred
  EXPECT_NEAR(noise.typicalSigma_px(), 0.8, 0.02);
  learnImages(0.36, 9, &noise);  // three times the memory
  EXPECT_NEAR(noise.typicalSigma_px(), 0.6, 0.03);
}

TEST(MeasurementNoise, NeverSinksBelowItsBoundAndComesBackFromIt) {
  FilterOptions options;
  MeasurementNoise noise(options);
  learnImages(1e-8, 300, &noise);
  EXPECT_EQ(noise.typicalSigma_px(), options.minimum_sigma_px);
  EXPECT_GE(noise.sigma_px({1e-6}, LandmarkNoise()), options.minimum_sigma_px);
  learnImages(0.25, 20, &noise);
  EXPECT_NEAR(noise.typicalSigma_px(), 0.5, 0.03);
}

TEST(MeasurementNoise, LearnsTheVarianceInflationOfCorrelatedErrors) {
  for (const double phi : {0.0, 0.5, 0.8}) {
    std::mt19937 random(3);
    std::vector<double> inflations;
    for (int i = 0; i < 400; ++i) {
      LandmarkNoise landmark;
      learnResiduals(1.0, phi, 200, &random, &landmark);
      ASSERT_TRUE(landmark.hasInflation());
      inflations.push_back(landmark.inflation());
    }
    MeasurementNoise noise{FilterOptions()};
    noise.learnInflation(inflations);
    // Of the exponentially weighted mean of a first-order Gauss-Markov process; for an infinite
    // window (1 + phi) / (1 - phi).
    const double kept = 1.0 - 2.0 / (LandmarkNoise::kWindow + 1);
    const double expected = (1.0 + phi * kept) / (1.0 - phi * kept);
    EXPECT_NEAR(noise.inflation(), expected, 0.15 * expected) << phi;
  }
}

TEST(MeasurementNoise, FollowsAnInflationThatChanges) {
  MeasurementNoise noise{FilterOptions()};
  for (int k = 0; k < 200; ++k) noise.learnInflation(std::vector<double>(40, 6.0));
  EXPECT_NEAR(noise.inflation(), 6.0, 1e-6);
  for (int k = 0; k < 200; ++k) noise.learnInflation(std::vector<double>(40, 0.5));
  EXPECT_EQ(noise.inflation(), 1.0) << "at least";
}

TEST(MeasurementNoise, ItsBoundIsOneOfTheLongRunVariance) {
  MeasurementNoise noise{FilterOptions()};
  learnImages(1e-6, 100, &noise);
  for (int k = 0; k < 100; ++k) noise.learnInflation(std::vector<double>(40, 6.0));
  EXPECT_NEAR(noise.inflation(), 6.0, 0.1);
  EXPECT_EQ(noise.inflation(typical_fits.front(), LandmarkNoise()), 1.0)
      << "white noise of the bound is far more than the errors";
}

TEST(LandmarkNoise, ShrinksTowardsTheOthersUntilItHasResidualsOfItsOwn) {
  std::mt19937 random(5);
  LandmarkNoise landmark;
  EXPECT_EQ(landmark.scale(), 1.0);
  learnResiduals(9.0, 0.0, 3, &random, &landmark);
  EXPECT_LT(landmark.scale(), 4.0);
  learnResiduals(9.0, 0.0, 400, &random, &landmark);
  EXPECT_NEAR(landmark.scale(), 9.0, 1.5);
  LandmarkNoise quiet;
  learnResiduals(0.25, 0.0, 400, &random, &quiet);
  EXPECT_NEAR(quiet.scale(), 0.25, 0.1);
}

TEST(LandmarkNoise, OneWrongMatchDoesNotDecide) {
  std::mt19937 random(7);
  LandmarkNoise landmark;
  learnResiduals(1.0, 0.0, 100, &random, &landmark);
  const double before = landmark.scale();
  landmark.learn(Eigen::Vector2d(1e3, -1e3));
  EXPECT_LT(landmark.scale(), before + 0.2);
  landmark.learn(Eigen::Vector2d(std::numeric_limits<double>::quiet_NaN(), 0.0));
  EXPECT_TRUE(std::isfinite(landmark.scale()));
}

TEST(MeasurementNoise, LearnsNothingFromWhatIsNotFiniteOrEmpty) {
  MeasurementNoise noise{FilterOptions()};
  learnImages(0.04, 10, &noise);
  const double before = noise.typicalSigma_px();
  noise.learn(std::numeric_limits<double>::quiet_NaN(), 70.0);
  noise.learn(-1.0, 70.0);
  noise.learn(1.0, 0.0);
  noise.learnInflation({});
  EXPECT_EQ(noise.typicalSigma_px(), before);
  noise.reset();
  EXPECT_EQ(noise.typicalSigma_px(), FilterOptions().sigma_px);
}

}  // namespace
}  // namespace active_matching_slam
