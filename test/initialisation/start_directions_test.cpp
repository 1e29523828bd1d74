#include "../../src/filter/start_directions.h"

#include <gtest/gtest.h>

#include <cmath>

#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

class StartDirections : public ::testing::Test {
 protected:
  std::vector<Bundle> readings(const Bundle& truth) const {
    Bundle turned = truth;
    flatten(model_, options_.inverse_depth, &turned);
    return readingsByDirection(model_, options_, turned);
  }

  const CameraModel model_{exampleCalibration()};
  BundleOptions options_ = weakPrior();
};

TEST_F(StartDirections, TheFirstReadingGoesTheWayOfTheCameraForwardsNotBackwards) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const Bundle truth = exampleBundle(model_, 3, 60, 0.02, 0.1, seed);
    const std::vector<Bundle> found = readings(truth);
    ASSERT_FALSE(found.empty());
    EXPECT_GT(
        cosineBetween(found[0].cameras.back().position_world, truth.cameras.back().position_world),
        std::cos(20.0 * M_PI / 180.0))
        << seed;
    // What is near is near.
    int right = 0, told = 0;
    for (std::size_t i = 0; i < truth.features.size(); ++i) {
      const double depth = truth.features[i].inverse_depth;
      if (std::abs(depth - 1.0) < 0.3) continue;
      ++told;
      right += (found[0].features[i].inverse_depth > options_.inverse_depth) == (depth > 1.0);
    }
    EXPECT_GT(right, 0.8 * told) << seed;
  }
}

TEST_F(StartDirections, WrongMatchesDoNotMakeItAnother) {
  options_.outlier_px = 0.5;
  Bundle truth = exampleBundle(model_, 3, 60, 0.02, 0.1, 3);
  for (std::size_t i = 0; i < truth.observations.back().size(); i += 6)
    truth.observations.back()[i].pixel += Eigen::Vector2d(-15.0, 10.0);
  const std::vector<Bundle> found = readings(truth);
  ASSERT_FALSE(found.empty());
  EXPECT_GT(
      cosineBetween(found[0].cameras.back().position_world, truth.cameras.back().position_world),
      std::cos(25.0 * M_PI / 180.0));
}

TEST_F(StartDirections, AdjustedTheFirstReadingCostsNoMoreThanTheTruth) {
  options_.sigma_px = 0.1;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Bundle truth = exampleBundle(model_, 5, 60, 0.01, 0.1, seed);
    Bundle found = readings(truth).front();
    const double cost = adjustBundle(model_, options_, &found);
    EXPECT_LT(cost, 1.02 * adjustBundle(model_, options_, &truth)) << seed;
  }
}

TEST_F(StartDirections, WithoutImagePointsOrMoveNothingIsNoNumber) {
  Bundle still = exampleBundle(model_, 3, 60, 0.0, 0.0, 1);
  Bundle empty = still;
  empty.observations.back().clear();
  for (const Bundle& bundle : {still, empty})
    for (const Bundle& reading : readings(bundle)) {
      EXPECT_TRUE(reading.cameras.back().position_world.allFinite());
      for (const FeatureState& feature : reading.features)
        EXPECT_TRUE(std::isfinite(feature.inverse_depth) && feature.inverse_depth > 0.0);
    }
}

}  // namespace
}  // namespace active_matching_slam
