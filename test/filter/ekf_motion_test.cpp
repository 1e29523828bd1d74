#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/math/rotation.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

constexpr double kInterval_s = 0.05;  // of exampleFilter()'s last prediction

CameraModel exampleModel() { return CameraModel(exampleCalibration()); }

UncertainVector known(const Eigen::Vector3d& mean, double sigma) {
  return {mean, sigma * sigma * Eigen::Matrix3d::Identity()};
}

/// Displacement since the last prediction by its interval, in the camera as it was before.
Eigen::Vector3d velocityAtStart(const CameraState& camera) {
  const Eigen::Vector3d back = -kInterval_s * camera.angular_velocity_camera;
  return (camera.q_world_camera * rotationFromVector(back)).conjugate() * camera.velocity_world;
}

MotionMeasurement asPredicted(const Ekf& filter, double sigma) {
  MotionMeasurement motion;
  motion.angular_velocity_camera = known(filter.camera().angular_velocity_camera, sigma);
  motion.velocity_start = known(velocityAtStart(filter.camera()), sigma);
  return motion;
}

TEST(EkfMotion, CovarianceIsThatOfAPlainUpdateByANumericalJacobian) {
  const Ekf before = exampleFilter(exampleModel(), 3);
  const double sigma = 0.03;
  const int n = before.stateSize();
  Eigen::MatrixXd H(6, n);
  for (int i = 0; i < n; ++i) {
    Eigen::Matrix<double, 6, 1> ends[2];
    for (int side = 0; side < 2; ++side) {
      CameraState camera = before.camera();
      std::vector<FeatureState> features = before.features();
      const double h = side == 0 ? -1e-6 : 1e-6;
      applyError(h * Eigen::VectorXd::Unit(n, i), camera, features);
      ends[side] << camera.angular_velocity_camera, velocityAtStart(camera);
    }
    H.col(i) = (ends[1] - ends[0]) / 2e-6;
  }
  const Eigen::MatrixXd P = before.covariance();
  const Eigen::MatrixXd S = H * P * H.transpose() + sigma * sigma * Eigen::MatrixXd::Identity(6, 6);
  const Eigen::MatrixXd expected = P - P * H.transpose() * S.inverse() * H * P;

  Ekf filter = before;
  const MotionReport report = filter.measureMotion(asPredicted(before, sigma), Corrected::kAll);
  EXPECT_TRUE(report.healthy);
  EXPECT_NEAR(report.rotation.nis, 0.0, 1e-12);
  EXPECT_NEAR(report.translation->nis, 0.0, 1e-12);
  EXPECT_EQ(report.translation->inflation, 1.0);
  EXPECT_LT((Eigen::MatrixXd(filter.covariance()) - expected).norm(), 1e-6 * P.norm());
}

TEST(EkfMotion, AnExactMeasurementIsBelievedHoweverFarTheCameraHasTurned) {
  Ekf filter = exampleFilter(exampleModel(), 4);
  const Eigen::Quaterniond q_start =
      filter.camera().q_world_camera *
      rotationFromVector(-kInterval_s * filter.camera().angular_velocity_camera);
  FilterOptions wide = filter.options();
  wide.sigma_acceleration_mps2 = wide.sigma_angular_acceleration_rps2 = 1000.0;
  filter.setOptions(wide);
  filter.replaceAccelerations({1000.0, 1000.0});
  MotionMeasurement motion;
  motion.angular_velocity_camera = known({20.0, -10.0, 5.0}, 1e-6);  // more than a radian
  motion.velocity_start = known({3.0, 2.0, -4.0}, 1e-6);
  filter.measureMotion(motion, Corrected::kAll);
  EXPECT_TRUE(
      filter.camera().angular_velocity_camera.isApprox(motion.angular_velocity_camera.mean, 1e-6));
  EXPECT_TRUE(velocityAtStart(filter.camera()).isApprox(motion.velocity_start->mean, 0.02));
  const Eigen::Quaterniond q_now =
      filter.camera().q_world_camera *
      rotationFromVector(-kInterval_s * filter.camera().angular_velocity_camera);
  EXPECT_LT(q_start.angularDistance(q_now), 0.02) << "where the interval began";
}

TEST(EkfMotion, ASlipIsNotFollowed) {
  const Ekf before = exampleFilter(exampleModel(), 5);
  Ekf filter = before;
  MotionMeasurement motion = asPredicted(before, 0.02);
  motion.velocity_start->mean += Eigen::Vector3d(20.0, 0.0, 0.0);
  const MotionReport report = filter.measureMotion(motion, Corrected::kAll);
  EXPECT_GT(report.translation->inflation, 1e3);
  EXPECT_EQ(report.rotation.inflation, 1.0);
  EXPECT_LT((filter.camera().velocity_world - before.camera().velocity_world).norm(), 0.5);
}

TEST(EkfMotion, LeavesLessOfTheImpulseAndNothingIsKnownOnceTheImageHasBeenFused) {
  Ekf filter = exampleFilter(exampleModel(), 6);
  const auto before = *filter.impulse();
  filter.measureMotion(asPredicted(filter, 1e-4), Corrected::kAll);
  const auto left = *filter.impulse();
  for (int i = 0; i < 6; ++i) EXPECT_LT(left[i], 0.1 * before[i]) << i;
  Random random(1);
  filter.update(exampleModel(), noisyMeasurements(filter, exampleModel(), 1.0, random));
  EXPECT_FALSE(filter.impulse());
  const Eigen::Vector3d velocity = filter.camera().velocity_world;
  MotionMeasurement motion = asPredicted(filter, 0.01);
  motion.velocity_start->mean.setConstant(7.0);
  filter.measureMotion(motion, Corrected::kAll);
  EXPECT_EQ(filter.camera().velocity_world, velocity);
}

TEST(EkfMotion, AMapThatStaysIsNotMoved) {
  const Ekf before = exampleFilter(exampleModel(), 7);
  Ekf filter = before;
  MotionMeasurement motion = asPredicted(before, 0.01);
  motion.velocity_start->mean *= 1.5;
  motion.angular_velocity_camera.mean *= 1.5;
  filter.measureMotion(motion, Corrected::kCamera);
  const int rest = filter.stateSize() - CameraError::kSize;
  EXPECT_EQ(Eigen::MatrixXd(filter.covariance().bottomRightCorner(rest, rest)),
            Eigen::MatrixXd(before.covariance().bottomRightCorner(rest, rest)));
  for (std::size_t i = 0; i < before.features().size(); ++i)
    EXPECT_EQ(filter.features()[i].position(), before.features()[i].position());
  EXPECT_NE(filter.camera().velocity_world, before.camera().velocity_world);
}

TEST(EkfMotion, ALoosenedScaleIsFoundByDisplacements) {
  const CameraModel model = exampleModel();
  Random random(8);
  Ekf filter = exampleFilter(model, 8);
  filter.fixScale(1e-4);
  EXPECT_LT(filter.scaleSigma(), 0.005);
  // All lengths are 5 % too large.
  const double wrong = 1.05;
  filter.rescale(wrong);
  filter.loosenScale(0.1);
  EXPECT_NEAR(filter.scaleSigma(), 0.1, 0.005);
  const FeatureId id = filter.features()[0].id;
  const double depth = (filter.find(id)->position() - filter.camera().position_world).norm();
  for (int i = 0; i < 30; ++i) {
    filter.predict(kInterval_s);
    const CameraState& camera = filter.camera();
    MotionMeasurement motion;
    motion.angular_velocity_camera = known(camera.angular_velocity_camera, 0.01);
    motion.velocity_start =
        known(velocityAtStart(camera) * std::exp(-std::log(wrong) * (i == 0)), 0.01);
    filter.measureMotion(motion, Corrected::kAll);
    filter.update(model, noisyMeasurements(filter, model, 0.01, random));
  }
  EXPECT_LT(filter.scaleSigma(), 0.05);
  EXPECT_LT((filter.find(id)->position() - filter.camera().position_world).norm(), 1.2 * depth);
}

TEST(EkfMotion, AGyroscopesBiasIsFoundAndKeptFromMapToMap) {
  const CameraModel model = exampleModel();
  Random random(9);
  Ekf filter(exampleOptions());
  filter.estimateGyroBias(0.1);
  EXPECT_EQ(filter.stateSize(), CameraError::kSize + 3);
  filter.reset(exampleCamera(random), exampleCameraCovariance(random));
  for (int i = 0; i < 12; ++i) {
    const auto bearing = model.unproject(random.pixel());
    filter.addPointFeature(filter.camera().poseWorldCamera() * (2.0 * *bearing),
                           1e-6 * Eigen::Matrix3d::Identity());
  }
  // The truth: the camera as it is, turning on at its rate over the points as they are.
  CameraState truth = filter.camera();
  std::vector<Eigen::Vector3d> points;
  for (const FeatureState& feature : filter.features()) points.push_back(feature.point_world);
  const Eigen::Vector3d bias(0.05, -0.03, 0.02);
  for (int i = 0; i < 10; ++i) {
    filter.predict(kInterval_s);
    truth.position_world += kInterval_s * truth.velocity_world;
    truth.q_world_camera =
        truth.q_world_camera * rotationFromVector(kInterval_s * truth.angular_velocity_camera);
    MotionMeasurement motion;
    motion.is_biased = true;
    motion.bias_walk_rps = 1e-5;
    motion.angular_velocity_camera =
        known(truth.angular_velocity_camera + bias + random.vector(1e-3), 1e-3);
    filter.measureMotion(motion, Corrected::kAll);
    std::vector<FeatureMeasurement> seen;
    for (std::size_t k = 0; k < points.size(); ++k)
      if (const auto pixel = model.project(truth.poseWorldCamera().inverse() * points[k]))
        seen.push_back({filter.features()[k].id,
                        *pixel + Eigen::Vector2d(random.normal(0.1), random.normal(0.1)), 0.1});
    filter.update(model, seen);
  }
  EXPECT_LT((*filter.camera().gyro_bias_rps - bias).norm(), 0.01);
  const Eigen::MatrixXd P = filter.covariance();
  const Eigen::Matrix3d P_bias = P.block<3, 3>(CameraError::kGyroBias, CameraError::kGyroBias);
  EXPECT_LT(P_bias.diagonal().maxCoeff(), 0.01 * 0.01);
  EXPECT_EQ(filter.savedCovariance().rows(), filter.stateSize() - 3);

  // A map that was saved and restored, and one begun anew, both know it.
  Ekf restored = filter;
  restored.restore(filter.camera(), filter.features(), filter.savedCovariance(), filter.nextId());
  EXPECT_EQ(restored.stateSize(), filter.stateSize());
  EXPECT_EQ(*restored.camera().gyro_bias_rps, *filter.camera().gyro_bias_rps);
  EXPECT_EQ(restored.savedCovariance(), filter.savedCovariance());
  const Eigen::Vector3d found = *filter.camera().gyro_bias_rps;
  filter.reset(CameraState(), MotionCovariance::Identity());
  EXPECT_EQ(*filter.camera().gyro_bias_rps, found);
  EXPECT_EQ(Eigen::Matrix3d(filter.covariance().bottomRightCorner<3, 3>()), P_bias);
}

}  // namespace
}  // namespace active_matching_slam
