// Corrections of the camera alone: the map is considered (Schmidt 1966), not corrected.

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "active_matching_slam/filter/ekf.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

FilterOptions withoutRepetition() {
  FilterOptions options = exampleOptions();
  options.update_iterations = 1;
  return options;
}

TEST(ConsideredMap, StaysAsItIsToTheBit) {
  const CameraModel model(exampleCalibration());
  Ekf filter = exampleFilter(model, 1);
  Random random(5);
  const auto measurements = noisyMeasurements(filter, model, 1.0, random);
  const std::vector<FeatureState> features = filter.features();
  const Eigen::MatrixXd before = filter.covariance();
  const int rest = filter.stateSize() - CameraError::kSize;
  const UpdateReport report = filter.update(model, measurements, {}, Corrected::kCamera);
  ASSERT_GT(report.used, 5);
  const Eigen::MatrixXd after = filter.covariance();
  EXPECT_EQ(after.bottomRightCorner(rest, rest), before.bottomRightCorner(rest, rest));
  for (std::size_t i = 0; i < features.size(); ++i)
    EXPECT_EQ(filter.features()[i].position(), features[i].position());
  EXPECT_NE(after.topLeftCorner(12, 12), before.topLeftCorner(12, 12));
}

TEST(ConsideredMap, LeavesTheCameraTheMeanOfTheWholeUpdate) {
  const CameraModel model(exampleCalibration());
  Ekf whole = exampleFilter(model, 2, 6, {}, withoutRepetition());
  Ekf considered = whole;
  Random random(6);
  const auto measurements = noisyMeasurements(whole, model, 1.0, random);
  whole.update(model, measurements);
  considered.update(model, measurements, {}, Corrected::kCamera);
  EXPECT_LT((whole.camera().position_world - considered.camera().position_world).norm(), 1e-12);
  EXPECT_LT(
      (whole.camera().q_world_camera.coeffs() - considered.camera().q_world_camera.coeffs()).norm(),
      1e-12);
}

TEST(ConsideredMap, LeavesACovariance) {
  const CameraModel model(exampleCalibration());
  Ekf filter = exampleFilter(model, 3);
  Random random(7);
  for (int step = 0; step < 20; ++step) {
    filter.update(model, noisyMeasurements(filter, model, 1.0, random), {}, Corrected::kCamera);
    const Eigen::MatrixXd P = filter.covariance();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(P, Eigen::EigenvaluesOnly);
    EXPECT_GT(solver.eigenvalues().minCoeff(), -1e-9 * solver.eigenvalues().maxCoeff());
    filter.predict(0.05);
  }
}

/// However often the camera looks, it knows its place no better than the map is known.
TEST(ConsideredMap, ItsUncertaintyIsTheLeastThatTheCameraHas) {
  constexpr double kCommonSigma_m = 0.1;
  const CameraModel model(exampleCalibration());
  Random random(8);
  Ekf filter(exampleOptions());
  filter.reset(CameraState(), exampleCameraCovariance(random));
  constexpr int kPoints = 30;
  for (int i = 0; i < kPoints; ++i)
    filter.addPointFeature(random.uniform(2.0, 3.0) * *model.unproject(random.pixel()),
                           1e-6 * Eigen::Matrix3d::Identity());
  // All points may be off by the same.
  Eigen::MatrixXd P = filter.covariance();
  for (int i = 0; i < kPoints; ++i)
    for (int j = 0; j < kPoints; ++j)
      P.block<3, 3>(CameraError::kSize + 3 * i, CameraError::kSize + 3 * j) +=
          kCommonSigma_m * kCommonSigma_m * Eigen::Matrix3d::Identity();
  filter.restore(filter.camera(), filter.features(), P, filter.nextId());
  for (int step = 0; step < 100; ++step) {
    filter.update(model, noisyMeasurements(filter, model, 1.0, random), {}, Corrected::kCamera);
    filter.predict(0.03);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma_m = std::sqrt(filter.covariance()(axis, axis));
    EXPECT_GT(sigma_m, 0.99 * kCommonSigma_m);
    EXPECT_LT(sigma_m, 2.0 * kCommonSigma_m);
  }
}

}  // namespace
}  // namespace active_matching_slam
