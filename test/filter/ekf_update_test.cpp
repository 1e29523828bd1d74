#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <limits>

#include "active_matching_slam/filter/ekf.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

class EkfUpdate : public ::testing::Test {
 protected:
  const CameraModel model_{exampleCalibration()};
};

/// Through the lens that the filter believes in.
std::optional<FeatureProjection> seenBy(const Ekf& filter, const CameraModel& model,
                                        const FeatureState& feature) {
  return projectFeature(model.corrected(filter.camera().lens), filter.camera(), feature);
}

/// H written out in full.
Eigen::MatrixXd denseJacobian(const Ekf& filter, const CameraModel& model,
                              const std::vector<FeatureId>& ids) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * ids.size(), filter.stateSize());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState& feature = *filter.find(ids[i]);
    const auto projection = seenBy(filter, model, feature);
    H.block<2, CameraError::kSize>(2 * i, 0) = projection->d_camera;
    H.block(2 * i, feature.offset, 2, feature.size()) =
        projection->d_feature.leftCols(feature.size());
  }
  return H;
}

/// R: pixel noise, and what linearisation leaves out.
Eigen::MatrixXd measurementNoise(const Ekf& filter, const CameraModel& model,
                                 const std::vector<FeatureId>& ids) {
  const int rows = 2 * static_cast<int>(ids.size());
  CovarianceMatrix P;
  P.reset(filter.stateSize());
  P.view() = filter.covariance();
  Eigen::MatrixXd R =
      filter.options().sigma_px * filter.options().sigma_px * Eigen::MatrixXd::Identity(rows, rows);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState& feature = *filter.find(ids[i]);
    if (feature.kind != FeatureKind::kInverseDepth) continue;
    R.block<2, 2>(2 * i, 2 * i) +=
        secondOrderNoise(*seenBy(filter, model, feature), relativeCovariance(feature, P));
  }
  return R;
}

double relativeDifference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() / b.norm();
}

constexpr double kTailDegrees = 4.0, kTailVariance = 1.18;

/// Of the variance of an image's matches, in what was expected.
double commonNoise(double nis, double degrees) { return (80.0 + nis / 0.85) / (80.0 + degrees); }

TEST_F(EkfUpdate, TellsHowMuchOfItsNoiseEachMatchStillShows) {
  Ekf filter = exampleFilter(model_, 1, 6);
  FilterOptions once = filter.options();
  once.update_iterations = 1;
  filter.setOptions(once);
  const PredictedMeasurements predicted = filter.predictMeasurements(model_, idsOf(filter));
  std::vector<FeatureMeasurement> measurements;
  for (std::size_t i = 0; i < predicted.ids.size(); ++i)
    measurements.push_back({predicted.ids[i], predicted.z.segment<2>(2 * i), 0.0});
  measurements.insert(measurements.begin() + 1, {12345, Eigen::Vector2d(1.0, 1.0), 0.0});
  const UpdateReport report = filter.update(model_, measurements);
  ASSERT_EQ(report.noise_left.size(), measurements.size());
  EXPECT_EQ(report.noise_left[1], 0.0) << "of no feature";
  // Matches that are not off at all are those of the t distribution's middle.
  const double expected_px2 = once.sigma_px * once.sigma_px;
  const double variance_px2 = kTailVariance * kTailDegrees / (kTailDegrees + 2.0) *
                              commonNoise(0.0, predicted.z.size()) * expected_px2;
  Eigen::MatrixXd S = predicted.S;
  S.diagonal().array() += variance_px2 - expected_px2;
  const Eigen::MatrixXd inverse = S.inverse();
  for (std::size_t i = 0; i < predicted.ids.size(); ++i) {
    // The covariance of R S^-1 y, over that of the match.
    const double plain = 0.5 * variance_px2 * inverse.block<2, 2>(2 * i, 2 * i).trace();
    const double left = report.noise_left[i == 0 ? 0 : i + 1];
    EXPECT_NEAR(left, plain, 1e-9);
    EXPECT_GT(left, 0.0);
    EXPECT_LT(left, 1.0);
  }
}

TEST_F(EkfUpdate, PredictedMeasurementsEqualThePlainFormula) {
  for (const CameraState& calibration : {CameraState(), poorlyCalibratedCamera()}) {
    const Ekf filter = exampleFilter(model_, 1, 6, calibration);
    const PredictedMeasurements predicted = filter.predictMeasurements(model_, idsOf(filter));
    ASSERT_GT(predicted.ids.size(), 12u);
    const Eigen::MatrixXd H = denseJacobian(filter, model_, predicted.ids);
    Eigen::MatrixXd S = H * filter.covariance() * H.transpose();
    S += measurementNoise(filter, model_, predicted.ids);
    EXPECT_LT(relativeDifference(predicted.S, S), 1e-13);
    EXPECT_EQ(predicted.S, predicted.S.transpose().eval());
  }
}

double sigmaOf(const FeatureMeasurement& m) {
  return m.sigma_px > 0.0 ? m.sigma_px : exampleOptions().sigma_px;
}

/// Makes the noise of all matches in `R`, and in `S`, larger or smaller by what they all disagree
/// by, and of each that with which a t distribution weighs it, by what it and all others disagree
/// by: each is predicted from the others, by regression. Returns how many are far off.
int weighTails(const std::vector<FeatureMeasurement>& measurements,
               const Eigen::VectorXd& innovation, Eigen::MatrixXd S, Eigen::MatrixXd* R) {
  const int n = static_cast<int>(innovation.size()), rest = n - 2;
  const double common = commonNoise(innovation.dot(S.inverse() * innovation), n);
  std::vector<double> own_px2, more_px2(n / 2, 0.0);
  for (int i = 0; i < n; i += 2) {
    own_px2.push_back(common * std::pow(sigmaOf(measurements[i / 2]), 2));
    const Eigen::Matrix2d change =
        (1.0 - 1.0 / common) * own_px2.back() * measurements[i / 2].noise_shape;
    R->block<2, 2>(i, i) += change;
    S.block<2, 2>(i, i) += change;
  }
  const Eigen::MatrixXd expected_R = *R;
  int far_off = 0;
  for (int round = 0; round < 4; ++round) {
    far_off = 0;
    double change = 0.0;
    for (int i = 0; i < n; i += 2) {
      Eigen::VectorXi order(n);
      for (int k = 0; k < rest; ++k) order[k] = k < i ? k : k + 2;
      order.tail<2>() << i, i + 1;
      const Eigen::PermutationMatrix<Eigen::Dynamic> own_last(order);
      const Eigen::VectorXd y = own_last.transpose() * innovation;
      const Eigen::MatrixXd C = own_last.transpose() * S * own_last;
      const Eigen::MatrixXd gain =
          C.bottomLeftCorner(2, rest) * C.topLeftCorner(rest, rest).inverse();
      const Eigen::Vector2d left = y.tail<2>() - gain * y.head(rest);
      Eigen::Matrix2d covariance = C.bottomRightCorner<2, 2>() - gain * C.topRightCorner(rest, 2);
      covariance -= more_px2[i / 2] * measurements[i / 2].noise_shape;
      const double chi2 = left.dot(covariance.inverse() * left);
      const double factor = kTailVariance * (kTailDegrees + chi2) / (kTailDegrees + 2.0);
      const double more = (factor - 1.0) * own_px2[i / 2];
      change =
          std::max(change, std::abs(more - more_px2[i / 2]) / (own_px2[i / 2] + more_px2[i / 2]));
      more_px2[i / 2] = more;
      far_off += chi2 > 9.0;
    }
    const Eigen::MatrixXd R_before = *R;
    for (int i = 0; i < n; i += 2)
      R->block<2, 2>(i, i) =
          expected_R.block<2, 2>(i, i) + more_px2[i / 2] * measurements[i / 2].noise_shape;
    S += *R - R_before;
    if (change <= 0.02) break;
  }
  return far_off;
}

/// By what impulses of unit covariance move the error state, from what predict() adds for them.
Eigen::MatrixXd impulseRoot(const Ekf& before, double interval_s) {
  Ekf moved = before, nearly_free = before;
  FilterOptions options = before.options();
  const double V =
      std::pow(options.sigma_acceleration_mps2 * interval_s, 2) - std::pow(0.001 * interval_s, 2);
  options.sigma_acceleration_mps2 = options.sigma_angular_acceleration_rps2 = 0.001;
  nearly_free.setOptions(options);
  moved.predict(interval_s);
  nearly_free.predict(interval_s);
  const Eigen::MatrixXd added = moved.covariance() - nearly_free.covariance();
  Eigen::MatrixXd G(added.rows(), 6);  // an impulse is what the velocity gains
  G << added.middleCols<3>(CameraError::kVelocity),
      added.middleCols<3>(CameraError::kAngularVelocity);
  return G / V * before.options().sigma_acceleration_mps2 * interval_s;
}

TEST_F(EkfUpdate, EqualsTheRestByErrorsThatLastAndThenTheImpulseByThoseOfAnImage) {
  int far_off = 0;
  for (const unsigned seed : {1u, 2u, 3u}) {
    Ekf filter =
        exampleFilter(model_, seed, 6, seed == 1u ? CameraState() : poorlyCalibratedCamera());
    Random random(seed + 100);
    auto measurements = noisyMeasurements(filter, model_, 3.0, random);
    measurements.resize(measurements.size() / 2);
    FilterOptions once = filter.options();
    once.update_iterations = 1;
    filter.setOptions(once);
    measurements[1].sigma_px = 2.5;
    for (std::size_t i = 0; i < measurements.size(); i += 2)
      measurements[i].noise_shape << 1.0 + 0.1 * i, 0.3, 0.3, 1.0 - 0.1 * i;
    if (seed != 2u)
      for (std::size_t i = 0; i < measurements.size(); ++i)
        measurements[i].repetitions = 1.0 + 3.0 * i;
    const Eigen::MatrixXd G = impulseRoot(filter, 0.01);
    filter.predict(0.01);
    const Ekf before = filter;
    const UpdateReport report = filter.update(model_, measurements);
    ASSERT_TRUE(report.healthy);
    ASSERT_EQ(report.used, static_cast<int>(measurements.size()));

    std::vector<FeatureId> ids;
    for (const auto& m : measurements) ids.push_back(m.id);
    const int n = before.stateSize(), rows = 2 * static_cast<int>(ids.size());
    const Eigen::MatrixXd H = denseJacobian(before, model_, ids);
    const Eigen::MatrixXd P = before.covariance();
    Eigen::MatrixXd R = measurementNoise(before, model_, ids);
    for (std::size_t i = 0; i < ids.size(); ++i)
      R.block<2, 2>(2 * i, 2 * i) +=
          std::pow(sigmaOf(measurements[i]), 2) * measurements[i].noise_shape -
          once.sigma_px * once.sigma_px * Eigen::Matrix2d::Identity();
    const Eigen::MatrixXd S_before = H * P * H.transpose() + R;
    Eigen::VectorXd innovation(rows);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      innovation.segment<2>(2 * i) =
          measurements[i].pixel - seenBy(before, model_, *before.find(ids[i]))->pixel;
    }
    far_off += weighTails(measurements, innovation, S_before, &R);
    // What was there before the impulse, by errors that last; the impulse, given that, by R alone.
    Eigen::MatrixXd lasting = Eigen::MatrixXd::Zero(rows, rows);
    for (std::size_t i = 0; i < ids.size(); ++i)
      lasting.block<2, 2>(2 * i, 2 * i) = (measurements[i].repetitions - 1.0) *
                                          std::pow(sigmaOf(measurements[i]), 2) *
                                          measurements[i].noise_shape;
    const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(n, n), B = H * G;
    const Eigen::MatrixXd P_rest = P - G * G.transpose();
    const Eigen::MatrixXd N = B * B.transpose() + R;
    const Eigen::MatrixXd K_rest =
        P_rest * H.transpose() * (H * P_rest * H.transpose() + N + lasting).inverse();
    const Eigen::MatrixXd P_then = (I - K_rest * H) * P_rest * (I - K_rest * H).transpose() +
                                   K_rest * (N + lasting) * K_rest.transpose();
    const Eigen::MatrixXd GK = G * B.transpose() * N.inverse();
    const Eigen::VectorXd rest = K_rest * innovation;
    const Eigen::VectorXd delta = rest + GK * (innovation - H * rest);
    const Eigen::MatrixXd T = I - GK * H;
    const Eigen::MatrixXd joint = T * P_then * T.transpose() +
                                  (G - GK * B) * (G - GK * B).transpose() + GK * R * GK.transpose();
    CameraState camera = before.camera();
    std::vector<FeatureState> features = before.features();
    applyError(delta, camera, features);
    CovarianceMatrix prior;
    prior.reset(n);
    prior.view() = P;
    const Eigen::MatrixXd L = gaugeFunctionals(before.camera(), before.features(), prior);
    const Eigen::MatrixXd change = gaugeGenerators(camera, features, n) -
                                   gaugeGenerators(before.camera(), before.features(), n);
    const Eigen::MatrixXd M = Eigen::MatrixXd::Identity(n, n) + change * L.transpose();

    EXPECT_LT(relativeDifference(filter.covariance(), M * joint * M.transpose()), 1e-10);
    EXPECT_LT(errorBetween(camera, features, filter.camera(), filter.features(), n).norm(), 1e-10);
    EXPECT_NEAR(report.nis, innovation.dot(S_before.inverse() * innovation), 1e-8 * report.nis);
  }
  EXPECT_GT(far_off, 2);
}

TEST_F(EkfUpdate, AMatchThatDisagreesWithAllOthersMovesTheRestLessTheFartherOffItIs) {
  const Ekf before = exampleFilter(model_, 1, 6);
  const PredictedMeasurements predicted = before.predictMeasurements(model_, idsOf(before));
  const auto moveByOneOff = [&](double px) {
    std::vector<FeatureMeasurement> measurements;
    for (std::size_t i = 0; i < predicted.ids.size(); ++i)
      measurements.push_back({predicted.ids[i], predicted.z.segment<2>(2 * i), 0.0});
    measurements[2].pixel.x() += px;
    Ekf filter = before;
    EXPECT_TRUE(filter.update(model_, measurements).healthy);
    return (filter.camera().position_world - before.camera().position_world).eval();
  };
  // A Gaussian would have the rest moved in proportion.
  const double near = moveByOneOff(1.0).norm();
  EXPECT_LT(moveByOneOff(12.0).norm(), 0.5 * 12.0 * near);
  EXPECT_LT(moveByOneOff(40.0).norm(), 0.5 * moveByOneOff(12.0).norm());
}

/// Minus twice the logarithm of the posterior density.
double posteriorCost(const Ekf& before, const Ekf& after, const CameraModel& model,
                     const std::vector<FeatureMeasurement>& measurements) {
  const Eigen::VectorXd delta = errorBetween(before.camera(), before.features(), after.camera(),
                                             after.features(), before.stateSize());
  double cost = delta.dot(Eigen::MatrixXd(before.covariance()).ldlt().solve(delta));
  for (const FeatureMeasurement& m : measurements) {
    const auto projection = seenBy(after, model, *after.find(m.id));
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

TEST_F(EkfUpdate, TheCalibrationGetsItsShareOfACorrection) {
  FilterOptions options = exampleOptions();
  options.update_iterations = 1;
  Ekf whole = exampleFilter(model_, 10, 6, CameraState(), options);
  options.calibration_share = 0.25;
  Ekf partial = exampleFilter(model_, 10, 6, CameraState(), options);
  partial.restore(whole.camera(), whole.features(), whole.covariance(), whole.nextId());
  const CameraState prior = whole.camera();
  const Eigen::MatrixXd P = whole.covariance();
  std::vector<FeatureMeasurement> measurements;
  for (const FeatureState& feature : whole.features())
    measurements.push_back(
        {feature.id, seenBy(whole, model_, feature)->pixel + Eigen::Vector2d(0.8, -0.5), 0.0});
  ASSERT_TRUE(whole.update(model_, measurements).healthy);
  ASSERT_TRUE(partial.update(model_, measurements).healthy);

  const CalibrationVector correction = calibrationOf(whole.camera()) - calibrationOf(prior);
  EXPECT_GT(correction.norm(), 1e-5);
  EXPECT_LT(
      relativeDifference(calibrationOf(partial.camera()) - calibrationOf(prior), 0.25 * correction),
      1e-9);
  EXPECT_EQ(partial.camera().position_world, whole.camera().position_world);
  EXPECT_EQ(partial.camera().q_world_camera.coeffs(), whole.camera().q_world_camera.coeffs());
  // What is not made stays as uncertain as it was: (1 - 0.25)^2 of the variance explained.
  Eigen::MatrixXd expected = whole.covariance();
  auto block = expected.block<5, 5>(CameraError::kReadout, CameraError::kReadout);
  EXPECT_GT((P.block<5, 5>(CameraError::kReadout, CameraError::kReadout) - block).trace(), 1e-8);
  block +=
      0.5625 * (P.block<5, 5>(CameraError::kReadout, CameraError::kReadout) - block.eval()).eval();
  EXPECT_LT(relativeDifference(partial.covariance(), expected), 1e-12);
}

TEST_F(EkfUpdate, ACameraThatMayHaveSlowedDownIsNotSureOfIt) {
  Ekf filter = exampleFilter(model_, 12);
  const CameraState before = filter.camera();
  const Eigen::MatrixXd P = filter.covariance();
  filter.doubtVelocity(0.25);
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
  EXPECT_LT(relativeDifference(calm.predictMeasurements(model_, predicted.ids, jerks).S, expected),
            1e-3);

  Random random(6);
  calm.update(model_, noisyMeasurements(calm, model_, 1.0, random));
  EXPECT_EQ(calm.predictMeasurements(model_, predicted.ids, jerks).S,
            calm.predictMeasurements(model_, predicted.ids).S)
      << "the accelerations since are no longer apart in the state";
}

}  // namespace
}  // namespace active_matching_slam
