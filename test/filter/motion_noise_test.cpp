#include "active_matching_slam/filter/motion_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

constexpr double kRate_hz = 30.0;

/// What updates tell that resolve the impulses of accelerations of these sigmas wholly.
UpdateReport resolved(const Accelerations& truth, const Accelerations& allowed,
                      std::mt19937* random) {
  std::normal_distribution<double> normal;
  UpdateReport report;
  report.linear.degrees = report.angular.degrees = 3.0;
  for (int axis = 0; axis < 3; ++axis) {
    report.linear.squares += std::pow(normal(*random) * truth.linear_mps2 / allowed.linear_mps2, 2);
    report.angular.squares +=
        std::pow(normal(*random) * truth.angular_rps2 / allowed.angular_rps2, 2);
  }
  return report;
}

void move(const Accelerations& truth, int images, std::mt19937* random, MotionNoise* noise) {
  for (int k = 0; k < images; ++k)
    noise->learn(resolved(truth, noise->expected(), random), noise->expected(), 1.0 / kRate_hz);
}

TEST(MotionNoise, IsTheWidestUntilItIsLearntAndAfterALoss) {
  const FilterOptions options;
  MotionNoise noise(options);
  EXPECT_EQ(noise.expected().linear_mps2, options.sigma_acceleration_mps2);
  EXPECT_EQ(noise.expected().angular_rps2, options.sigma_angular_acceleration_rps2);
  std::mt19937 random(1);
  move({0.5, 1.0}, 30, &random, &noise);
  EXPECT_LT(noise.expected().linear_mps2, 0.5 * options.sigma_acceleration_mps2);
  noise.reset();
  EXPECT_EQ(noise.expected().linear_mps2, noise.widest().linear_mps2);
  EXPECT_EQ(noise.expected().angular_rps2, noise.widest().angular_rps2);
}

TEST(MotionNoise, FallsToASmoothMotionWithinItsMemoryAndRisesWithAJerkAtOnce) {
  const FilterOptions options;
  MotionNoise noise(options);
  std::mt19937 random(2);
  const Accelerations smooth{0.1, 0.2}, jerk{5.0, 8.0};
  move(smooth, static_cast<int>(options.motion_memory_s * kRate_hz), &random, &noise);
  EXPECT_LT(noise.expected().linear_mps2, 0.1 * options.sigma_acceleration_mps2);
  EXPECT_LT(noise.expected().angular_rps2, 0.1 * options.sigma_angular_acceleration_rps2);
  move(smooth, 300, &random, &noise);
  const Accelerations before = noise.expected();
  move(jerk, 1, &random, &noise);
  EXPECT_GT(noise.expected().linear_mps2, 3.0 * before.linear_mps2);
  EXPECT_GT(noise.expected().angular_rps2, 3.0 * before.angular_rps2);
}

/// Of many runs, so that the mean of what is predicted is compared with what is true.
TEST(MotionNoise, PredictsTheVarianceOfAStudentWithItsDegrees) {
  const FilterOptions options;
  const Accelerations truth{0.5, 1.0};
  std::mt19937 random(3);
  MotionNoise noise(options);
  double sum = 0.0;
  constexpr int kImages = 4000;
  for (int k = 0; k < kImages; ++k) {
    move(truth, 1, &random, &noise);
    sum += std::pow(noise.expected().linear_mps2 / truth.linear_mps2, 2);
  }
  // The scale's mean is the truth; the predictive variance of n degrees is n / (n - 2) as large,
  // and that of a sum of accelerations that last for 0.1 s, 1 + 2 (e + e^2 + ...) times, e =
  // exp(-dt / 0.1).
  const double degrees = 3.0 * options.motion_memory_s * kRate_hz;
  double long_run = 1.0;
  for (int lag = 1; lag < 100; ++lag) long_run += 2.0 * std::exp(-lag / (0.1 * kRate_hz));
  EXPECT_NEAR(sum / kImages / long_run, degrees / (degrees - 2.0), 0.1);
}

TEST(MotionNoise, StaysWhereImagesTellNothingAndNeverExceedsTheWidest) {
  const FilterOptions options;
  MotionNoise noise(options);
  std::mt19937 random(4);
  move({0.5, 1.0}, 60, &random, &noise);
  const Accelerations before = noise.expected();
  for (int k = 0; k < 1000; ++k) noise.learn(UpdateReport(), before, 1.0 / kRate_hz);
  EXPECT_EQ(noise.expected().linear_mps2, before.linear_mps2);
  EXPECT_EQ(noise.expected().angular_rps2, before.angular_rps2);
  move({1e3, 1e3}, 5, &random, &noise);
  EXPECT_EQ(noise.expected().linear_mps2, options.sigma_acceleration_mps2);
  EXPECT_EQ(noise.expected().angular_rps2, options.sigma_angular_acceleration_rps2);
}

TEST(MotionNoise, CountsJerks) {
  MotionNoise never(FilterOptions{}), often(FilterOptions{});
  const double before = never.jerkProbability();
  EXPECT_GT(before, 0.0);
  EXPECT_LT(before, 0.2);
  for (int k = 0; k < 1000; ++k) {
    never.countImage(false);
    often.countImage(k % 4 == 0);
  }
  EXPECT_GT(never.jerkProbability(), 0.0) << "the next may come";
  EXPECT_LT(never.jerkProbability(), 0.1 * before);
  EXPECT_NEAR(often.jerkProbability(), 0.25, 0.01);
}

TEST(MotionNoise, GrowsWithTheUnitOfTheMap) {
  MotionNoise noise(FilterOptions{});
  std::mt19937 random(5);
  move({0.05, 1.0}, 60, &random, &noise);
  const Accelerations before = noise.expected();
  noise.rescale(3.0);
  EXPECT_DOUBLE_EQ(noise.expected().linear_mps2, 3.0 * before.linear_mps2);
  EXPECT_EQ(noise.expected().angular_rps2, before.angular_rps2);
}

/// Cameras drawn from the filter's state, moved by drawn accelerations: what the updates tell of
/// these is right where the filter allows for as much, and tells too little from too much.
TEST(MotionNoise, LearnsTheAccelerationsOfACameraFromTheUpdatesOfItsFilter) {
  const CameraModel model(exampleCalibration());
  constexpr double kInterval_s = 0.05, kSigma_px = 0.5;
  const Accelerations truth{6.0, 9.0};
  for (const double factor : {0.3, 1.0, 4.0}) {
    ImpulseEstimate linear, angular;
    for (unsigned seed = 1; seed <= 60; ++seed) {
      Ekf filter = exampleFilter(model, 5);
      Random random(seed);
      Eigen::VectorXd error(filter.stateSize());
      for (double& e : error) e = random.normal();
      error = symmetricRoot(filter.covariance()) * error;
      CameraState camera = filter.camera();
      std::vector<FeatureState> features = filter.features();
      applyError(error, camera, features);
      if (std::any_of(features.begin(), features.end(), [](const FeatureState& feature) {
            return feature.kind == FeatureKind::kInverseDepth && !(feature.inverse_depth > 0.0);
          }))
        continue;
      camera.velocity_world += random.vector(truth.linear_mps2 * kInterval_s);
      camera.angular_velocity_camera += random.vector(truth.angular_rps2 * kInterval_s);
      Ekf moved = filter;
      moved.restore(camera, features, filter.covariance(), filter.nextId());
      moved.predict(kInterval_s);

      filter.predict(kInterval_s, {factor * truth.linear_mps2, factor * truth.angular_rps2});
      std::vector<FeatureMeasurement> measurements =
          noisyMeasurements(moved, model, kSigma_px, random);
      for (FeatureMeasurement& m : measurements) m.sigma_px = kSigma_px;
      const UpdateReport report = filter.update(model, measurements);
      linear.squares += report.linear.squares;
      linear.degrees += report.linear.degrees;
      angular.squares += report.angular.squares;
      angular.degrees += report.angular.degrees;
    }
    for (const ImpulseEstimate& estimate : {linear, angular}) {
      // Of 60 runs and some axes each; what is not resolved draws the ratio towards one.
      ASSERT_GT(estimate.degrees, 10.0) << factor;
      const double ratio = estimate.squares / estimate.degrees;
      if (factor < 1.0) {
        EXPECT_GT(ratio, 1.5);
      } else if (factor > 1.0) {
        EXPECT_LT(ratio, 0.6);
      } else {
        EXPECT_NEAR(ratio, 1.0, 0.35);
      }
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
