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
  const double cost = adjustBundle(model, weakPrior(), &bundle).cost;
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
  double cost = adjustBundle(model, thorough, &bundle).cost;
  for (int again = 0; again < 20; ++again) cost = adjustBundle(model, thorough, &bundle).cost;
  BundleOptions evaluate = options;
  evaluate.max_iterations = 0;
  const auto rise = [&](auto change) {
    Bundle moved = bundle;
    change(moved);
    return adjustBundle(model, evaluate, &moved).cost - cost;
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

TEST(BundleAdjustment, ComesToTheSameFromAnyScale) {
  const CameraModel model(exampleCalibration());
  Bundle bundle = exampleBundle(model, 8, 30, 0.05, 0.5, 9), other = bundle;
  rescaleBundle(1e4, &other);
  EXPECT_NEAR(adjustBundle(model, weakPrior(), &bundle).cost,
              adjustBundle(model, weakPrior(), &other).cost, 1e-6);
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
  EXPECT_LT(adjustBundle(model, weakPrior(), &bundle).cost, 5.0);
  EXPECT_LT((bundle.features[7].bearing_world - bearing).norm(), 1e-12);
  EXPECT_LT(featureErrors(model, bundle)[6], 0.02);
}

TEST(BundleAdjustment, SaysWhetherItConvergedAndGoesOnWhereItWas) {
  const CameraModel model(exampleCalibration());
  Bundle at_once = withoutKnowledge(exampleBundle(model, 8, 30, 0.05, 0.5, 8)), in_steps = at_once;
  BundleOptions options = weakPrior();
  options.max_iterations = 100;
  const BundleFit whole = adjustBundle(model, options, &at_once);
  EXPECT_TRUE(whole.converged);
  options.max_iterations = 1;
  BundleFit fit;
  int steps = 0;
  while (!fit.converged && ++steps < 100) fit = adjustBundle(model, options, &in_steps);
  EXPECT_GT(steps, 1);
  EXPECT_NEAR(fit.cost, whole.cost, 0.01 * whole.cost);
}

TEST(BundleAdjustment, OfARotationOnlyNoCameraLeavesTheOrigin) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 6, 30, 0.05, 0.1, 8);
  Bundle rotated = withoutKnowledge(truth), moved = rotated;
  BundleOptions options = weakPrior();
  const double cost = adjustBundle(model, options, &moved).cost;
  options.rotation_only = true;
  EXPECT_GT(adjustBundle(model, options, &rotated).cost, cost);
  for (const CameraState& camera : rotated.cameras) EXPECT_LT(camera.position_world.norm(), 1e-9);
}

TEST(BundleAdjustment, AnOutlyingFeatureHardlyMovesTheRest) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 30, 0.05, 0.1, 4);
  Bundle clean = truth, disturbed = truth;
  for (std::size_t k = 0; k < truth.cameras.size(); ++k)
    for (BundleObservation& o : disturbed.observations[k])
      if (o.feature == 7) o.pixel.y() += 2.0 * static_cast<double>(k);  // not along its ray
  BundleOptions options = weakPrior();
  options.sigma_px = 0.1;
  adjustBundle(model, options, &clean);
  adjustBundle(model, options, &disturbed);
  EXPECT_LT((clean.cameras.back().position_world - disturbed.cameras.back().position_world).norm(),
            0.03 * clean.cameras.back().position_world.norm());
  const std::vector<double> errors = featureErrors(model, disturbed);
  EXPECT_GT(errors[7], 1.0);
  EXPECT_LT(errors[6], 0.3);
}

TEST(BundleAdjustment, EstimatesTheNoiseOfItsImagePointsWhateverSomeFeaturesDo) {
  const CameraModel model(exampleCalibration());
  constexpr double kSigmaPx = 0.2;
  double squares = 0.0;
  constexpr int kRuns = 10;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Bundle bundle = exampleBundle(model, 8, 60, 0.05, kSigmaPx, seed);
    for (std::size_t k = 0; k < bundle.cameras.size(); ++k)
      for (BundleObservation& o : bundle.observations[k])
        if (o.feature % 10 == 0) o.pixel.y() += static_cast<double>(k % 2) * 8.0;
    BundleOptions options = weakPrior();
    options.sigma_px = 0.3;
    adjustBundle(model, options, &bundle);
    squares += std::pow(estimateSigma(model, bundle), 2) / kRuns;
  }
  EXPECT_GT(std::sqrt(squares), 0.9 * kSigmaPx);
  EXPECT_LT(std::sqrt(squares), 1.5 * kSigmaPx);  // not the four pixels of a tenth of them
}

TEST(BundleAdjustment, NoisyImagePointsCountForLess) {
  const CameraModel model(exampleCalibration());
  const Bundle truth = exampleBundle(model, 8, 30, 0.05, 0.0, 4);
  BundleOptions options = weakPrior();
  options.sigma_px = 0.1;
  options.loss_scale_sigmas = 1e6;
  const auto adjusted = [&](double noise) {
    Bundle bundle = truth;
    Random random(5);
    for (auto& observations : bundle.observations)
      for (BundleObservation& o : observations) {
        if (o.feature % 3 != 0) continue;
        o.pixel += Eigen::Vector2d(random.normal(1.0), random.normal(1.0));
        o.relative_sigma = noise;
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
    for (BundleObservation& o : observations) o.relative_sigma = 2.0;
  BundleOptions twice_by_options = options;
  twice_by_options.sigma_px = 0.2;
  const Eigen::VectorXd weights = Eigen::VectorXd::Constant(30, 1.0 / 30.0);
  const Eigen::MatrixXd a = bundleCovariance(model, options, twice, 1, 1.0, weights, 1e-3);
  const Eigen::MatrixXd b = bundleCovariance(model, twice_by_options, truth, 1, 1.0, weights, 1e-3);
  EXPECT_LT((a - b).norm(), 1e-6 * b.norm());
}

}  // namespace
}  // namespace active_matching_slam
