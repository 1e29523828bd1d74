#include "../../src/initialisation/hypothesis_test.h"

#include <gtest/gtest.h>

#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

TEST(HypothesisTest, OddsAreThoseOfTheLikelihoodsOfIndependentErrors) {
  // A cost is minus twice a log likelihood.
  EXPECT_DOUBLE_EQ(logOdds(10.0, 16.0, 1.0), 3.0);
  EXPECT_DOUBLE_EQ(logOdds(16.0, 10.0, 1.0), -3.0);
  // Errors that repeat three times count once.
  EXPECT_DOUBLE_EQ(logOdds(30.0, 48.0, 3.0), 3.0);
}

class MotionTests : public testing::Test {
 protected:
  std::optional<MotionTest> test(Bundle bundle, double correlation_inflation = 1.0) const {
    for (FeatureState& feature : bundle.features) feature.inverse_depth = 1.0;
    for (std::size_t k = 1; k < bundle.cameras.size(); ++k) {
      bundle.cameras[k].position_world.setZero();
      alignRotation(model_, static_cast<int>(k), &bundle);
    }
    InitialiserOptions options;
    options.correlation_inflation = correlation_inflation;
    return testMotions(model_, options, weakPrior(), bundle);
  }

  const CameraModel model_{exampleCalibration()};
};

TEST_F(MotionTests, AcceptTheTrueMotionOnceItIsClear) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Bundle truth = exampleBundle(model_, 8, 60, 0.02, 0.1, seed);
    const auto result = test(truth);
    ASSERT_TRUE(result) << seed;
    EXPECT_GT(cosineBetween(result->accepted.cameras.back().position_world,
                            truth.cameras.back().position_world),
              0.99);
    EXPECT_NEAR(result->sigma_px, 0.1, 0.03);
  }
}

TEST_F(MotionTests, AcceptNothingWhenTheCameraOnlyRotates) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Bundle bundle = exampleBundle(model_, 8, 60, 0.0, 0.0, seed);
    Random random(seed);
    for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
      bundle.cameras[k].q_world_camera = rotationFromVector(Eigen::Vector3d(0.0, 0.01 * k, 0.0));
      bundle.observations[k].clear();
      for (std::size_t i = 0; i < bundle.features.size(); ++i) {
        const auto p = projectFeature(model_, bundle.cameras[k], bundle.features[i]);
        const double du = random.normal(0.2), dv = random.normal(0.2);
        if (p && model_.isInImage(p->pixel))
          bundle.observations[k].push_back(
              {static_cast<int>(i), p->pixel + Eigen::Vector2d(du, dv)});
      }
    }
    EXPECT_FALSE(test(bundle)) << seed;
  }
}

TEST_F(MotionTests, WaitLongerWhenErrorsAreCorrelated) {
  int by_independent = 0, by_correlated = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Bundle truth = exampleBundle(model_, 8, 60, 0.002, 0.1, seed);
    by_independent += test(truth, 1.0).has_value();
    by_correlated += test(truth, 20.0).has_value();
  }
  EXPECT_LE(by_correlated, by_independent);
}

}  // namespace
}  // namespace active_matching_slam
