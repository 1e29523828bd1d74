#include "../../src/initialisation/motion_candidates.h"

#include <gtest/gtest.h>

#include <cmath>

#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

class MotionCandidates : public ::testing::Test {
 protected:
  std::vector<Bundle> candidates(const Bundle& truth) const {
    Bundle rotation_only = truth;
    for (FeatureState& feature : rotation_only.features) feature.inverse_depth = 1.0;
    for (std::size_t k = 1; k < truth.cameras.size(); ++k) {
      rotation_only.cameras[k].position_world.setZero();
      alignRotation(model_, static_cast<int>(k), &rotation_only);
    }
    return motionCandidates(model_, options_, rotation_only);
  }

  const CameraModel model_{exampleCalibration()};
  BundleOptions options_ = weakPrior();
};

TEST_F(MotionCandidates, TheFirstGoesTheWayOfTheCameraForwardsNotBackwards) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const Bundle truth = exampleBundle(model_, 3, 60, 0.02, 0.1, seed);
    const std::vector<Bundle> found = candidates(truth);
    ASSERT_FALSE(found.empty());
    EXPECT_GT(
        cosineBetween(found[0].cameras.back().position_world, truth.cameras.back().position_world),
        std::cos(20.0 * M_PI / 180.0))
        << seed;
    // What is near is near.
    int right = 0, counted = 0;
    for (std::size_t i = 0; i < truth.features.size(); ++i) {
      const double depth = truth.features[i].inverse_depth;
      if (std::abs(depth - 1.0) < 0.3) continue;
      ++counted;
      right += (found[0].features[i].inverse_depth > options_.inverse_depth) == (depth > 1.0);
    }
    EXPECT_GT(right, 0.8 * counted) << seed;
  }
}

TEST_F(MotionCandidates, WrongMatchesDoNotMakeItAnother) {
  options_.sigma_px = 0.2;
  Bundle truth = exampleBundle(model_, 3, 60, 0.02, 0.1, 3);
  for (std::size_t i = 0; i < truth.observations.back().size(); i += 6)
    truth.observations.back()[i].pixel += Eigen::Vector2d(-15.0, 10.0);
  const std::vector<Bundle> found = candidates(truth);
  ASSERT_FALSE(found.empty());
  EXPECT_GT(
      cosineBetween(found[0].cameras.back().position_world, truth.cameras.back().position_world),
      std::cos(25.0 * M_PI / 180.0));
}

TEST_F(MotionCandidates, AdjustedTheFirstCostsNoMoreThanTheTruth) {
  options_.sigma_px = 0.1;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Bundle truth = exampleBundle(model_, 5, 60, 0.01, 0.1, seed);
    Bundle found = candidates(truth).front();
    const double cost = adjustBundle(model_, options_, &found).cost;
    EXPECT_LT(cost, 1.02 * adjustBundle(model_, options_, &truth).cost) << seed;
  }
}

TEST_F(MotionCandidates, WithoutImagePointsOrMoveNothingIsNoNumber) {
  Bundle still = exampleBundle(model_, 3, 60, 0.0, 0.0, 1);
  Bundle empty = still;
  empty.observations.back().clear();
  for (const Bundle& bundle : {still, empty})
    for (const Bundle& candidate : candidates(bundle)) {
      EXPECT_TRUE(candidate.cameras.back().position_world.allFinite());
      for (const FeatureState& feature : candidate.features)
        EXPECT_TRUE(std::isfinite(feature.inverse_depth) && feature.inverse_depth > 0.0);
    }
}

TEST_F(MotionCandidates, EachIsFollowedByItsDepthReversal) {
  const std::vector<Bundle> found = candidates(exampleBundle(model_, 3, 60, 0.02, 0.1, 2));
  ASSERT_EQ(found.size() % 2, 0u);
  for (std::size_t i = 0; i < found.size(); i += 2)
    EXPECT_LT(cosineBetween(found[i].cameras.back().position_world,
                            found[i + 1].cameras.back().position_world),
              -0.999);
}

TEST_F(MotionCandidates, ForwardMotionIsAmongThem) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Bundle truth = forwardBundle(model_, 5, 80, 0.03, 0.1, seed);
    double best = -1.0;
    for (const Bundle& candidate : candidates(truth))
      best = std::max(best, cosineBetween(candidate.cameras.back().position_world,
                                          truth.cameras.back().position_world));
    EXPECT_GT(best, std::cos(20.0 * M_PI / 180.0)) << seed;
  }
}

TEST(DepthReversal, ExchangesNearAndFarAndKeepsWhatANarrowViewShows) {
  const CameraModel model(exampleCalibration());
  const Eigen::Vector2d middle(315.0, 243.0);
  Bundle truth = exampleBundle(model, 4, 300, 0.01, 0.0, 5);
  for (std::size_t k = 0; k < truth.cameras.size(); ++k) {
    truth.cameras[k] = CameraState();
    truth.cameras[k].position_world.x() = 0.01 * static_cast<double>(k);
    truth.observations[k].clear();
    for (std::size_t i = 0; i < truth.features.size(); ++i) {
      const auto first = projectFeature(model, truth.cameras.front(), truth.features[i]);
      const auto seen = projectFeature(model, truth.cameras[k], truth.features[i]);
      if (first && seen && (first->pixel - middle).norm() < 80.0)
        truth.observations[k].push_back({static_cast<int>(i), seen->pixel});
    }
  }
  Bundle reversed = truth;
  makeBasReliefCounterpart(model, &reversed);
  EXPECT_LT(
      cosineBetween(reversed.cameras.back().position_world, truth.cameras.back().position_world),
      -0.999);
  double motion = 0.0, error = 0.0;
  for (const BundleObservation& o : truth.observations.back()) {
    const auto first = projectFeature(model, truth.cameras.front(), truth.features[o.feature]);
    const auto seen = projectFeature(model, reversed.cameras.back(), reversed.features[o.feature]);
    motion += (o.pixel - first->pixel).norm();
    error += (o.pixel - seen->pixel).norm();
  }
  EXPECT_LT(error, 0.1 * motion);
  // Yet the images tell them apart.
  Bundle adjusted = reversed, right = truth;
  BundleOptions options = weakPrior();
  options.sigma_px = 0.05;
  EXPECT_GT(adjustBundle(model, options, &adjusted).cost,
            adjustBundle(model, options, &right).cost);
}

}  // namespace
}  // namespace active_matching_slam
