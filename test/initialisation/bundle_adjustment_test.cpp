#include "active_matching_slam/initialisation/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

/// All features at one depth and no camera moved: what is known before anything is.
Bundle withoutKnowledge(Bundle bundle) {
  for (FeatureState& feature : bundle.features) feature.inverse_depth = 1.0;
  for (CameraState& camera : bundle.cameras) camera = CameraState();
  return bundle;
}

TEST(BundleAdjustment, FindsPathAndDepthsUpToScaleFromNothing) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 40, 0.05, 0.0, 1);
  Bundle bundle = withoutKnowledge(truth);
  const double cost = adjustBundle(model, weakPrior(), &bundle);
  EXPECT_LT(cost, 5.0);  // of the prior
  const double scale =
      bundle.cameras.back().position_world.norm() / truth.cameras.back().position_world.norm();
  for (std::size_t k = 1; k < truth.cameras.size(); ++k) {
    EXPECT_LT((bundle.cameras[k].position_world - scale * truth.cameras[k].position_world).norm(),
              0.02 * scale * truth.cameras[k].position_world.norm())
        << k;
    EXPECT_LT(bundle.cameras[k].q_world_camera.angularDistance(truth.cameras[k].q_world_camera),
              2e-3)
        << k;
  }
  for (std::size_t i = 0; i < truth.features.size(); ++i)
    EXPECT_NEAR(bundle.features[i].inverse_depth * scale, truth.features[i].inverse_depth, 0.05)
        << i;
  for (const double error : featureErrors(model, bundle)) EXPECT_LT(error, 0.02);
}

TEST(BundleAdjustment, StopsWhereNoParameterCanLowerTheCost) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = weakPrior();
  Bundle bundle = withoutKnowledge(exampleBundle(model, 6, 30, 0.05, 0.5, 2));
  BundleOptions thorough = options;
  thorough.max_iterations = 200;
  double cost = adjustBundle(model, thorough, &bundle);
  for (int again = 0; again < 20; ++again) cost = adjustBundle(model, thorough, &bundle);
  BundleOptions evaluate = options;
  evaluate.max_iterations = 0;
  const auto rise = [&](auto change) {
    Bundle moved = bundle;
    change(moved);
    return adjustBundle(model, evaluate, &moved) - cost;
  };
  for (std::size_t k = 1; k < bundle.cameras.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1.0, 1.0}) {
        const Eigen::Vector3d d = sign * 1e-3 * Eigen::Vector3d::Unit(axis);
        EXPECT_GT(rise([&](Bundle& b) { b.cameras[k].position_world += d; }), 0.0);
        EXPECT_GT(rise([&](Bundle& b) {
                    b.cameras[k].q_world_camera =
                        rotationFromVector(d) * b.cameras[k].q_world_camera;
                  }),
                  0.0);
      }
    }
  }
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    for (const double sign : {-1.0, 1.0})
      EXPECT_GT(rise([&](Bundle& b) { b.features[i].inverse_depth += sign * 0.02; }), 0.0) << i;
}

TEST(BundleAdjustment, NoOtherUnitFitsThePriorOfDepthsBetter) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = weakPrior();
  Bundle bundle = exampleBundle(model, 4, 20, 0.05, 0.5, 4);
  const double error = featureErrors(model, bundle)[0];
  rescaleBundle(7.0, &bundle);
  const auto priorCost = [&options](const Bundle& b) {
    double cost = 0.0;
    for (const FeatureState& f : b.features)
      cost += std::pow((f.inverse_depth - options.inverse_depth) / options.sigma_inverse_depth, 2);
    return cost;
  };
  const double before = priorCost(bundle);
  const double fall = chooseUnit(options, &bundle);
  EXPECT_GT(fall, 0.0);
  EXPECT_NEAR(priorCost(bundle), before - fall, 1e-9 * before);
  EXPECT_NEAR(featureErrors(model, bundle)[0], error, 1e-9);
  for (const double factor : {0.99, 1.01}) {
    Bundle other = bundle;
    rescaleBundle(factor, &other);
    EXPECT_GT(priorCost(other), priorCost(bundle)) << factor;
  }
}

TEST(BundleAdjustment, ComesToTheSameFromAnyUnit) {
  const CameraModel model(exampleCalibration());
  Bundle bundle = exampleBundle(model, 8, 30, 0.05, 0.5, 9), other = bundle;
  rescaleBundle(1e4, &other);
  EXPECT_NEAR(adjustBundle(model, weakPrior(), &bundle), adjustBundle(model, weakPrior(), &other),
              1e-6);
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    EXPECT_NEAR(bundle.features[i].inverse_depth, other.features[i].inverse_depth, 1e-6) << i;
}

TEST(BundleAdjustment, AFeatureThatNoImageShowsIsNoFault) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 30, 0.05, 0.0, 6);
  Bundle bundle = withoutKnowledge(truth);
  for (auto& observations : bundle.observations)
    observations.erase(std::remove_if(observations.begin(), observations.end(),
                                      [](const BundleObservation& o) { return o.feature == 7; }),
                       observations.end());
  const Eigen::Vector3d bearing = bundle.features[7].bearing_world;
  EXPECT_LT(adjustBundle(model, weakPrior(), &bundle), 5.0);
  EXPECT_LT((bundle.features[7].bearing_world - bearing).norm(), 1e-12);
  EXPECT_LT(featureErrors(model, bundle)[6], 0.02);
}

TEST(BundleAdjustment, EndsEarlyWhereTheCostWontFallFarEnough) {
  const CameraModel model(exampleCalibration());
  Bundle full = exampleBundle(model, 8, 30, 0.05, 1.0, 8), brief = full;
  reverseDepths(model, &full);
  reverseDepths(model, &brief);
  BundleOptions options = weakPrior();
  const double reached = adjustBundle(model, options, &full);
  options.hopeless_cost = 1e-3 * reached;
  EXPECT_GT(adjustBundle(model, options, &brief), reached);
}

TEST(BundleAdjustment, AWanderingFeatureHardlyMovesTheRest) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 30, 0.05, 0.1, 4);
  Bundle clean = truth, disturbed = truth;
  for (std::size_t k = 0; k < truth.cameras.size(); ++k)
    for (BundleObservation& o : disturbed.observations[k])
      if (o.feature == 7) o.pixel.y() += 2.0 * static_cast<double>(k);  // not along its ray
  BundleOptions options = weakPrior();
  options.sigma_px = 0.1;
  options.outlier_px = 0.25;
  adjustBundle(model, options, &clean);
  adjustBundle(model, options, &disturbed);
  EXPECT_LT((clean.cameras.back().position_world - disturbed.cameras.back().position_world).norm(),
            0.03 * clean.cameras.back().position_world.norm());
  const std::vector<double> errors = featureErrors(model, disturbed);
  EXPECT_GT(errors[7], 1.0);
  EXPECT_LT(errors[6], 0.3);
}

TEST(BundleAdjustment, ErrorsOfImagesAreThoseOfTheirPoints) {
  const CameraModel model(exampleCalibration());
  Bundle bundle = exampleBundle(model, 4, 30, 0.05, 0.0, 4);
  for (BundleObservation& o : bundle.observations[2]) o.pixel += Eigen::Vector2d(0.3, -0.4);
  bundle.observations[3].clear();
  bundle.observations[1][0].pixel.x() += 100.0;
  const double points = static_cast<double>(bundle.observations[1].size());
  const std::vector<double> errors_px = imageErrors(model, bundle, 1.0);
  ASSERT_EQ(errors_px.size(), 4u);
  EXPECT_NEAR(errors_px[0], 0.0, 1e-9);
  EXPECT_NEAR(errors_px[1], std::sqrt(1.0 / points), 1e-9);  // one counts for one pixel
  EXPECT_NEAR(errors_px[2], std::sqrt(0.5) * 0.5, 1e-9);     // per axis
  EXPECT_EQ(errors_px[3], 0.0);
}

TEST(BundleAdjustment, NoisyImagePointsCountForLess) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 30, 0.05, 0.0, 4);
  BundleOptions options = weakPrior();
  options.sigma_px = 0.1;
  options.outlier_px = 1e6;
  const auto adjusted = [&](double noise) {
    Bundle bundle = truth;
    Random random(5);
    for (auto& observations : bundle.observations)
      for (BundleObservation& o : observations) {
        if (o.feature % 3 != 0) continue;
        o.pixel += Eigen::Vector2d(random.normal(1.0), random.normal(1.0));
        o.noise = noise;
      }
    adjustBundle(model, options, &bundle);
    return bundle;
  };
  const auto error = [&](const Bundle& bundle) {
    const Eigen::Vector3d& end = bundle.cameras.back().position_world;
    const Eigen::Vector3d& true_end = truth.cameras.back().position_world;
    return (end / end.norm() - true_end / true_end.norm()).norm();
  };
  EXPECT_LT(error(adjusted(10.0)), 0.5 * error(adjusted(1.0)));
  EXPECT_NEAR(featureErrors(model, adjusted(10.0))[0], 0.1, 0.05);

  Bundle twice = truth;
  for (auto& observations : twice.observations)
    for (BundleObservation& o : observations) o.noise = 2.0;
  BundleOptions twice_by_options = options;
  twice_by_options.sigma_px = 0.2;
  const Eigen::MatrixXd a =
      bundleCovariance(model, options, twice, 1, depthShares(model, options, twice), 1e-3);
  const Eigen::MatrixXd b = bundleCovariance(model, twice_by_options, truth, 1,
                                             depthShares(model, twice_by_options, truth), 1e-3);
  EXPECT_LT((a - b).norm(), 1e-6 * b.norm());
}

TEST(BundleAdjustment, ReversedDepthsExchangeNearAndFarAndKeepWhatANarrowViewShows) {
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
  reverseDepths(model, &reversed);
  EXPECT_LT(
      cosineBetween(reversed.cameras.back().position_world, truth.cameras.back().position_world),
      -0.999);
  double motion = 0.0, miss = 0.0;
  for (const BundleObservation& o : truth.observations.back()) {
    const auto first = projectFeature(model, truth.cameras.front(), truth.features[o.feature]);
    const auto seen = projectFeature(model, reversed.cameras.back(), reversed.features[o.feature]);
    motion += (o.pixel - first->pixel).norm();
    miss += (o.pixel - seen->pixel).norm();
  }
  EXPECT_LT(miss, 0.1 * motion);
  // Yet the images tell them apart.
  Bundle adjusted = reversed, right = truth;
  BundleOptions options = weakPrior();
  options.sigma_px = 0.05;
  EXPECT_GT(adjustBundle(model, options, &adjusted), adjustBundle(model, options, &right));
}

}  // namespace
}  // namespace active_matching_slam
