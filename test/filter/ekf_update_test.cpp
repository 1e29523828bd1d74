#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "active_matching_slam/filter/ekf.h"
#include "filter/example_filter.h"
#include "filter/plain_update.h"

namespace active_matching_slam {
namespace {

class EkfUpdate : public ::testing::Test {
 protected:
  const CameraModel model_{exampleCalibration()};
};

TEST_F(EkfUpdate, PredictedMeasurementsEqualThePlainFormula) {
  for (const CameraState& calibration : {CameraState(), poorlyCalibratedCamera()}) {
    const Ekf filter = exampleFilter(model_, 1, 6, calibration);
    for (const double sigma_px : {0.0, 0.3}) {
      const PredictedMeasurements predicted =
          filter.predictMeasurements(model_, idsOf(filter), sigma_px);
      ASSERT_GT(predicted.ids.size(), 12u);
      const Eigen::MatrixXd H = denseJacobian(filter, model_, predicted.ids);
      Eigen::MatrixXd S = H * filter.covariance() * H.transpose();
      S += denseSecondOrderNoise(filter, model_, predicted.ids);
      S.diagonal().array() += std::pow(sigma_px > 0.0 ? sigma_px : filter.options().sigma_px, 2);
      EXPECT_LT(relativeDifference(predicted.S, S), 1e-13);
      EXPECT_EQ(predicted.S, predicted.S.transpose().eval());
    }
  }
}

/// Minus twice the logarithm of the posterior density.
double posteriorCost(const Ekf& before, const Ekf& after, const CameraModel& model,
                     const std::vector<FeatureMeasurement>& measurements) {
  const Eigen::VectorXd delta = errorBetween(before.camera(), before.features(), after.camera(),
                                             after.features(), before.stateSize());
  double cost = delta.dot(Eigen::MatrixXd(before.covariance()).ldlt().solve(delta));
  for (const FeatureMeasurement& m : measurements) {
    const auto projection = projectIn(after, model, *after.find(m.id));
    const double sigma_px = before.options().sigma_px;
    cost += (m.pixel - projection->pixel).squaredNorm() / (sigma_px * sigma_px);
  }
  return cost;
}

TEST_F(EkfUpdate, RepeatedLinearisationFindsABetterMeanAfterALargeTurn) {
  Random random(11);
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << Eigen::Vector3d::Constant(0.1), Eigen::Vector3d::Constant(0.2),
      Eigen::Matrix<double, 6, 1>::Constant(0.1);
  Ekf prior(exampleOptions());
  prior.reset(CameraState(), sigma.cwiseAbs2().asDiagonal());
  CameraState truth;
  truth.position_world = Eigen::Vector3d(0.1, -0.1, 0.1);
  truth.q_world_camera = rotationFromVector(Eigen::Vector3d(0.2, -0.2, 0.3));
  std::vector<FeatureMeasurement> measurements;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d point = 2.0 * *model_.unproject(random.pixel());
    const FeatureId id = prior.addPointFeature(point, 1e-6 * Eigen::Matrix3d::Identity());
    const auto pixel = model_.project(truth.poseWorldCamera().inverse() * point);
    if (pixel) measurements.push_back({id, *pixel, 0.0});
  }
  double last_cost = std::numeric_limits<double>::infinity();
  for (const int iterations : {1, 2, 4}) {
    FilterOptions options = prior.options();
    options.update_iterations = iterations;
    Ekf filter = prior;
    filter.setOptions(options);
    ASSERT_TRUE(filter.update(model_, measurements).healthy);
    const double cost = posteriorCost(prior, filter, model_, measurements);
    EXPECT_LT(cost, 0.5 * last_cost) << iterations;
    last_cost = cost;
    if (iterations == 4) {
      EXPECT_LT((filter.camera().position_world - truth.position_world).norm(), 0.025);
    }
  }
}

TEST_F(EkfUpdate, AStartAtTheMeanIsAnUpdateThatMayGoOn) {
  const Ekf prior = exampleFilter(model_, 2);
  Random random(5);
  const auto measurements = noisyMeasurements(prior, model_, 1.0, random);
  Ekf started = prior, iterated = prior;
  FilterOptions options = prior.options();
  options.update_iterations = 8;
  iterated.setOptions(options);
  const Eigen::VectorXd nowhere = Eigen::VectorXd::Zero(prior.stateSize());
  started.update(model_, measurements, {}, Corrected::kAll, nowhere);
  iterated.update(model_, measurements);
  EXPECT_LT((started.camera().position_world - iterated.camera().position_world).norm(), 1e-9);
  EXPECT_LT(relativeDifference(started.covariance(), iterated.covariance()), 1e-7);
}

/// A wall that was mapped long ago, a camera that believes to be half a turn of the head and a
/// metre from where it is, and what it maps meanwhile.
TEST_F(EkfUpdate, FindsItsWayFromWhereTheCameraIsBelievedToBe) {
  Random random(21);
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << Eigen::Vector3d::Constant(0.8), Eigen::Vector3d::Constant(0.5),
      Eigen::Matrix<double, 6, 1>::Constant(0.1);
  Ekf prior(exampleOptions());
  prior.reset(CameraState(), sigma.cwiseAbs2().asDiagonal());
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.linear() = rotationFromVector(Eigen::Vector3d(0.3, -0.5, 0.4)).toRotationMatrix();
  moved.translation() << 0.5, -0.4, 0.7;
  std::vector<FeatureMeasurement> measurements;
  std::vector<FeatureId> carried;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector2d pixel = random.pixel();
    carried.push_back(prior.addInverseDepthFeature(model_, pixel, 0.4, 0.05));
    measurements.push_back({carried.back(), pixel, 0.0});
  }
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d pixel = random.pixel();
    const Eigen::Vector3d point = moved * (random.uniform(2.0, 4.0) * *model_.unproject(pixel));
    const FeatureId id = prior.addPointFeature(point, 1e-4 * Eigen::Matrix3d::Identity());
    measurements.push_back({id, pixel, 0.0});
  }
  Eigen::Isometry3d assumed = moved;  // as a resection would have it, a little off
  assumed.translation() += Eigen::Vector3d(0.02, 0.03, -0.02);
  const Eigen::VectorXd start =
      errorOfMotion(assumed, prior.camera(), prior.features(), carried, prior.stateSize());
  Ekf filter = prior;
  const UpdateReport report = filter.update(model_, measurements, {}, Corrected::kAll, start);
  EXPECT_TRUE(report.healthy);
  EXPECT_EQ(report.used, static_cast<int>(measurements.size()));
  EXPECT_LT((filter.camera().position_world - moved.translation()).norm(), 0.01);
  EXPECT_LT(vectorFromRotation(filter.camera().q_world_camera *
                               Eigen::Quaterniond(moved.linear()).conjugate())
                .norm(),
            0.003);
  for (const FeatureMeasurement& m : measurements)
    EXPECT_LT((projectIn(filter, model_, *filter.find(m.id))->pixel - m.pixel).norm(), 1.0);

  Ekf single = prior;
  single.update(model_, measurements);
  EXPECT_GT((single.camera().position_world - moved.translation()).norm(), 0.1);
}

TEST_F(EkfUpdate, AMotionOfTheWorldCarriesWhatIsNamedAndNothingElse) {
  const Ekf filter = exampleFilter(model_, 6);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = rotationFromVector(Eigen::Vector3d(0.7, -0.4, 1.1)).toRotationMatrix();
  motion.translation() << 3.0, -2.0, 1.0;
  std::vector<FeatureId> carried;
  for (const FeatureId id : idsOf(filter))
    if (id % 2 == 0) carried.push_back(id);
  CameraState camera = filter.camera();
  std::vector<FeatureState> features = filter.features();
  applyError(errorOfMotion(motion, camera, features, carried, filter.stateSize()), camera,
             features);
  EXPECT_TRUE(camera.poseWorldCamera().isApprox(motion * filter.camera().poseWorldCamera(), 1e-12));
  EXPECT_TRUE(camera.velocity_world.isApprox(motion.linear() * filter.camera().velocity_world));
  for (std::size_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector3d before = filter.features()[i].position();
    const Eigen::Vector3d expected =
        features[i].id % 2 == 0 && !features[i].anchored_at_origin ? motion * before : before;
    if (features[i].anchored_at_origin) continue;  // its anchor can't move
    EXPECT_TRUE(features[i].position().isApprox(expected, 1e-10)) << features[i].id;
  }
}

TEST_F(EkfUpdate, SkipsWhatCanNotBeFusedAndLeavesTheRestUntouched) {
  Ekf filter = exampleFilter(model_, 4);
  Ekf expected = filter;
  Random random(7);
  auto good = noisyMeasurements(filter, model_, 1.0, random);
  good.resize(3);
  const FeatureId behind =
      filter.addPointFeature(filter.camera().poseWorldCamera() * Eigen::Vector3d(0.1, 0.2, -2.0),
                             1e-4 * Eigen::Matrix3d::Identity());
  ASSERT_EQ(behind, expected.addPointFeature(filter.find(behind)->point_world,
                                             1e-4 * Eigen::Matrix3d::Identity()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  auto mixed = good;
  mixed.push_back({good[0].id, Eigen::Vector2d(nan, 100.0), 0.0});
  mixed.push_back({good[1].id, Eigen::Vector2d(100.0, infinity), 0.0});
  mixed.push_back({good[2].id, Eigen::Vector2d(100.0, 100.0), nan});
  mixed.push_back({behind, Eigen::Vector2d(100.0, 100.0), 0.0});
  mixed.push_back({12345, Eigen::Vector2d(100.0, 100.0), 0.0});
  mixed.push_back(good[0]);
  mixed.back().noise_shape(0, 1) = nan;
  const UpdateReport report = filter.update(model_, mixed);
  EXPECT_EQ(report.used, 3);
  EXPECT_EQ(report.skipped, 6);
  EXPECT_TRUE(report.healthy);
  expected.update(model_, good);
  EXPECT_EQ(filter.covariance(), expected.covariance());
  EXPECT_EQ(filter.camera().position_world, expected.camera().position_world);
}

TEST_F(EkfUpdate, WithoutMeasurementsChangesNothing) {
  Ekf filter = exampleFilter(model_, 5);
  const Eigen::MatrixXd before = filter.covariance();
  const UpdateReport report = filter.update(model_, {});
  EXPECT_EQ(report.used, 0);
  EXPECT_TRUE(report.healthy);
  EXPECT_EQ(filter.covariance(), before);
}

TEST_F(EkfUpdate, RefusesAnInnovationCovarianceThatCanNotBeFactorised) {
  Ekf filter(exampleOptions());
  Eigen::Matrix<double, 12, 12> indefinite = Eigen::Matrix<double, 12, 12>::Identity();
  indefinite(0, 0) = indefinite(1, 1) = -9.0;
  filter.reset(CameraState(), indefinite);
  const FeatureId id =
      filter.addPointFeature(Eigen::Vector3d(0.1, 0.1, 2.0), 1e-6 * Eigen::Matrix3d::Identity());
  const Eigen::MatrixXd before = filter.covariance();
  const UpdateReport report = filter.update(model_, {{id, Eigen::Vector2d(300.0, 200.0), 0.0}});
  EXPECT_FALSE(report.healthy);
  EXPECT_EQ(report.used, 0);
  EXPECT_EQ(filter.covariance(), before);
  EXPECT_EQ(filter.camera().position_world, Eigen::Vector3d::Zero());
}

TEST_F(EkfUpdate, SaysSoWhenItHadToRepairAVariance) {
  Ekf filter(exampleOptions());
  Eigen::Matrix<double, 12, 12> covariance = 1e-2 * Eigen::Matrix<double, 12, 12>::Identity();
  // Correlated beyond one: not a covariance, though what is measured has one.
  covariance(CameraError::kVelocity, CameraError::kPosition) = 0.05;
  covariance(CameraError::kPosition, CameraError::kVelocity) = 0.05;
  filter.reset(CameraState(), covariance);
  const FeatureId id =
      filter.addPointFeature(Eigen::Vector3d(0.1, 0.1, 1.0), 1e-6 * Eigen::Matrix3d::Identity());
  const auto predicted = filter.predictMeasurements(model_, {id});
  const UpdateReport report = filter.update(model_, {{id, predicted.z, 0.0}});
  EXPECT_FALSE(report.healthy);
  EXPECT_GE(filter.covariance().diagonal().minCoeff(), 0.0);
}

TEST_F(EkfUpdate, KeepsInverseDepthsAboveTheirMinimumWithoutTouchingTheCovariance) {
  // A parallax of the wrong sign: the best inverse depth is negative, beyond infinity.
  FilterOptions options = exampleOptions();
  options.minimum_inverse_depth = 1e-3;
  Ekf filter(options);
  CameraState camera;
  camera.velocity_world.x() = 1.0;
  filter.reset(camera, 1e-12 * Eigen::Matrix<double, 12, 12>::Identity());
  const FeatureId id = filter.addInverseDepthFeature(model_, Eigen::Vector2d(320.0, 240.0));
  FilterOptions still = options;
  still.sigma_acceleration_mps2 = still.sigma_angular_acceleration_rps2 = 1e-3;
  filter.setOptions(still);
  filter.predict(0.3);
  Ekf undisturbed = filter;
  const auto predicted = filter.predictMeasurements(model_, {id});
  const Eigen::Vector2d beyond(380.0, 240.0);
  ASSERT_GT(beyond.x(), predicted.z.x());
  const UpdateReport report = filter.update(model_, {{id, beyond, 0.0}});
  EXPECT_TRUE(report.healthy);
  EXPECT_EQ(filter.find(id)->inverse_depth, 1e-3);
  EXPECT_TRUE(filter.find(id)->position().allFinite());
  EXPECT_GT(filter.sigmaInverseDepth(*filter.find(id)), 0.0);
  // The limit applies to the mean alone: without it the covariance is the same.
  still.minimum_inverse_depth = 1e-9;
  undisturbed.setOptions(still);
  undisturbed.update(model_, {{id, beyond, 0.0}});
  EXPECT_EQ(undisturbed.covariance(), filter.covariance());
}

TEST_F(EkfUpdate, StaysSymmetricAndPositiveOverALongRun) {
  Ekf filter = exampleFilter(model_, 8);
  Random random(8);
  for (int frame = 0; frame < 300; ++frame) {
    filter.predict(1.0 / 30.0);
    const UpdateReport report =
        filter.update(model_, noisyMeasurements(filter, model_, 1.0, random));
    ASSERT_TRUE(report.healthy) << frame;
    filter.convertToPoints();
    if (frame % 5 == 0) {
      if (filter.features().size() > 20) filter.removeFeatures({filter.features().front().id});
      filter.addInverseDepthFeature(model_, random.pixel());
    }
    if (frame % 50 != 49) continue;
    const Eigen::MatrixXd P = filter.covariance();
    ASSERT_EQ(P, P.transpose().eval());
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P).eigenvalues();
    ASSERT_GT(values.minCoeff(), -1e-13 * values.maxCoeff()) << frame;
    ASSERT_NEAR(filter.camera().q_world_camera.norm(), 1.0, 1e-14);
  }
}

TEST_F(EkfUpdate, ACalibrationBeyondDoubtStaysAsItIs) {
  FilterOptions certain = exampleOptions();
  certain.initial_sigma_readout_s = certain.initial_sigma_focal = 0.0;
  certain.initial_sigma_radial = certain.initial_sigma_centre = 0.0;
  const CameraState given = poorlyCalibratedCamera();
  const Ekf filter = exampleFilter(model_, 10, 6, given, certain);
  EXPECT_TRUE(filter.covariance().middleRows<5>(CameraError::kReadout).isZero(0.0));
  EXPECT_TRUE(filter.covariance().middleCols<5>(CameraError::kReadout).isZero(0.0));
  EXPECT_EQ(filter.camera().readout_s, given.readout_s);
  EXPECT_EQ(filter.camera().lens.focal, given.lens.focal);
  EXPECT_EQ(filter.camera().lens.radial, given.lens.radial);
  EXPECT_EQ(filter.camera().lens.centre, given.lens.centre);
}

TEST_F(EkfUpdate, VelocitiesDecayAndWhatTheyLoseIsUncertainty) {
  Ekf filter = exampleFilter(model_, 12);
  const CameraState before = filter.camera();
  const Eigen::MatrixXd P = filter.covariance();
  filter.decayVelocity(0.25);
  const CameraState after = filter.camera();
  EXPECT_EQ(after.velocity_world, 0.25 * before.velocity_world);
  EXPECT_EQ(after.angular_velocity_camera, 0.25 * before.angular_velocity_camera);
  EXPECT_EQ(after.position_world, before.position_world);
  const Eigen::MatrixXd added = Eigen::MatrixXd(filter.covariance()) - P;
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(P.rows(), P.cols());
  const Eigen::Vector3d v = 0.75 * before.velocity_world, w = 0.75 * before.angular_velocity_camera;
  expected.block<3, 3>(CameraError::kVelocity, CameraError::kVelocity) = v * v.transpose();
  expected.block<3, 3>(CameraError::kAngularVelocity, CameraError::kAngularVelocity) =
      w * w.transpose();
  EXPECT_GT(expected.norm(), 1e-3);
  EXPECT_LT((added - expected).norm(), 1e-12);
}

TEST_F(EkfUpdate, IsTheSameBitForBitWhenRepeated) {
  const auto run = [this] {
    Ekf filter = exampleFilter(model_, 9, 40);
    Random random(9);
    filter.update(model_, noisyMeasurements(filter, model_, 1.0, random));
    return Eigen::MatrixXd(filter.covariance());
  };
  EXPECT_EQ(run(), run());
}

TEST_F(EkfUpdate, CovarianceForOtherAccelerationsIsWhatTheyWouldHavePredicted) {
  constexpr double kInterval = 0.04;
  const Accelerations jerks{5.0, 8.0};
  FilterOptions jerky_options = exampleOptions();
  jerky_options.sigma_acceleration_mps2 = jerks.linear_mps2;
  jerky_options.sigma_angular_acceleration_rps2 = jerks.angular_rps2;
  Ekf calm = exampleFilter(model_, 5), jerky = calm;
  jerky.setOptions(jerky_options);
  calm.predict(kInterval);
  jerky.predict(kInterval);
  const PredictedMeasurements predicted = calm.predictMeasurements(model_, idsOf(calm));
  const Eigen::MatrixXd expected = jerky.predictMeasurements(model_, predicted.ids).S;
  ASSERT_GT(relativeDifference(predicted.S, expected), 0.1);
  // But for what linearisation leaves out, which is that of the prediction made.
  EXPECT_LT(
      relativeDifference(calm.predictMeasurements(model_, predicted.ids, 0.0, jerks).S, expected),
      1e-3);

  Ekf replaced = calm;
  replaced.replaceAccelerations(jerks);
  EXPECT_LT(relativeDifference(Eigen::MatrixXd(replaced.covariance()),
                               Eigen::MatrixXd(jerky.covariance())),
            1e-12);

  Random random(6);
  calm.update(model_, noisyMeasurements(calm, model_, 1.0, random));
  EXPECT_EQ(calm.predictMeasurements(model_, predicted.ids, 0.0, jerks).S,
            calm.predictMeasurements(model_, predicted.ids).S)
      << "the accelerations since are no longer apart in the state";
}

}  // namespace
}  // namespace active_matching_slam
