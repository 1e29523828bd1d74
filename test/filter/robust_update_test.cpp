#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/filter/ekf.h"
#include "filter/chi_square.h"
#include "filter/example_filter.h"
#include "filter/plain_update.h"

namespace active_matching_slam {
namespace {

struct PlainCase {
  unsigned seed;
  CameraState calibration;
  bool correlated;
  double prior_degrees;
};

class PlainUpdate : public ::testing::TestWithParam<PlainCase> {};

TEST_P(PlainUpdate, OneLinearisationEqualsThePlainFormulae) {
  const CameraModel model{exampleCalibration()};
  FilterOptions once = exampleOptions();
  once.update_iterations = 1;
  Ekf filter = exampleFilter(model, GetParam().seed, 6, GetParam().calibration, once);
  Random random(GetParam().seed + 100);
  auto measurements = noisyMeasurements(filter, model, 3.0, random);
  measurements.resize(measurements.size() / 2);
  measurements[1].sigma_px = 2.5;
  for (std::size_t i = 0; i < measurements.size(); i += 2)
    measurements[i].noise_shape << 1.0 + 0.1 * i, 0.3, 0.3, 1.0 - 0.1 * i;
  if (GetParam().correlated)
    for (std::size_t i = 0; i < measurements.size(); ++i)
      measurements[i].variance_inflation = 1.0 + 3.0 * i;
  const Eigen::MatrixXd G = impulseRoot(filter, 0.01);
  filter.predict(0.01);
  const Ekf before = filter;
  const UpdateReport report = filter.update(model, measurements, {GetParam().prior_degrees});
  ASSERT_TRUE(report.healthy);
  ASSERT_EQ(report.used, static_cast<int>(measurements.size()));

  std::vector<FeatureId> ids;
  for (const auto& m : measurements) ids.push_back(m.id);
  const int rows = 2 * static_cast<int>(ids.size());
  const Eigen::MatrixXd H = denseJacobian(before, model, ids), P = before.covariance();
  const Eigen::MatrixXd HPH = H * P * H.transpose();
  const Eigen::MatrixXd second_order = denseSecondOrderNoise(before, model, ids);
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::VectorXd innovation(rows);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureMeasurement& m = measurements[i];
    const double sigma_px = m.sigma_px > 0.0 ? m.sigma_px : once.sigma_px;
    R.block<2, 2>(2 * i, 2 * i) = sigma_px * sigma_px * m.noise_shape;
    innovation.segment<2>(2 * i) = m.pixel - projectIn(before, model, *before.find(ids[i]))->pixel;
  }
  EXPECT_NEAR(report.nis, innovation.dot((HPH + R + second_order).inverse() * innovation),
              1e-8 * report.nis);

  // Reweighing may end after any round; all else has to be right.
  PlainNoise noise(innovation, HPH, R, second_order, GetParam().prior_degrees);
  double least = std::numeric_limits<double>::infinity(), scale = 0.0, delta = 0.0;
  for (int round = 0; round < 8; ++round) {
    noise.iterate();
    Eigen::MatrixXd correlated = noise.R();
    for (std::size_t i = 0; i < ids.size(); ++i)
      correlated.block<2, 2>(2 * i, 2 * i) *= measurements[i].variance_inflation - 1.0;
    const PlainPosterior posterior(P, H, G, noise.R() + second_order, correlated, innovation);
    CameraState camera = before.camera();
    std::vector<FeatureState> features = before.features();
    applyError(posterior.delta, camera, features);
    const double difference =
        relativeDifference(filter.covariance(), transported(before, posterior, camera, features));
    if (difference > least) continue;
    least = difference;
    scale = noise.scale();
    delta = errorBetween(camera, features, filter.camera(), filter.features(), before.stateSize())
                .norm() /
            posterior.delta.norm();
  }
  // The code rounds its factors of the t distribution to four digits.
  EXPECT_LT(least, 1e-4);
  EXPECT_LT(delta, 1e-4);
  EXPECT_NEAR(report.noise_scale, scale, 2e-4 * scale);
  EXPECT_GT(noise.farOff(), 0);
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();
INSTANTIATE_TEST_SUITE_P(Cases, PlainUpdate,
                         testing::Values(PlainCase{1, CameraState(), true, kInfinity},
                                         PlainCase{2, poorlyCalibratedCamera(), false, kInfinity},
                                         PlainCase{3, poorlyCalibratedCamera(), true, kInfinity},
                                         PlainCase{3, poorlyCalibratedCamera(), true, 40.0},
                                         PlainCase{2, CameraState(), false, 0.0}));

TEST(RobustUpdateOfExactMeasurements, HasTheWeightsAndRedundanciesOfTheTailsMiddle) {
  const CameraModel model{exampleCalibration()};
  FilterOptions once = exampleOptions();
  once.update_iterations = 1;
  Ekf filter = exampleFilter(model, 1, 6, CameraState(), once);
  const PredictedMeasurements predicted = filter.predictMeasurements(model, idsOf(filter));
  std::vector<FeatureMeasurement> measurements;
  for (std::size_t i = 0; i < predicted.ids.size(); ++i)
    measurements.push_back({predicted.ids[i], predicted.z.segment<2>(2 * i)});
  measurements.insert(measurements.begin() + 1, {12345, Eigen::Vector2d(1.0, 1.0)});
  const UpdateReport report = filter.update(model, measurements);
  ASSERT_EQ(report.redundancy.size(), measurements.size());
  EXPECT_EQ(report.redundancy[1], 0.0) << "of no feature";
  const TailModel tails;
  const double expected_px2 = once.sigma_px * once.sigma_px;
  const double variance_px2 = tails.varianceFactor() / tails.weight(0.0) * expected_px2;
  Eigen::MatrixXd S = predicted.S;
  S.diagonal().array() += variance_px2 - expected_px2;
  const Eigen::MatrixXd inverse = S.inverse();
  for (std::size_t i = 0; i < predicted.ids.size(); ++i) {
    // The covariance R S^-1 R of the post-fit residual R S^-1 y, over R.
    const double plain = 0.5 * variance_px2 * inverse.block<2, 2>(2 * i, 2 * i).trace();
    EXPECT_NEAR(report.redundancy[i == 0 ? 0 : i + 1], plain, 1e-4);
    EXPECT_GT(plain, 0.0);
    EXPECT_LT(plain, 1.0);
  }
}

TEST(RobustUpdateOfAnOutlier, MovesTheRestLessTheFartherOffItIs) {
  const CameraModel model{exampleCalibration()};
  const Ekf before = exampleFilter(model, 1, 6);
  const PredictedMeasurements predicted = before.predictMeasurements(model, idsOf(before));
  const auto moveByOneOff = [&](double px) {
    std::vector<FeatureMeasurement> measurements;
    for (std::size_t i = 0; i < predicted.ids.size(); ++i)
      measurements.push_back({predicted.ids[i], predicted.z.segment<2>(2 * i)});
    measurements[2].pixel.x() += px;
    Ekf filter = before;
    EXPECT_TRUE(filter.update(model, measurements).healthy);
    return (filter.camera().position_world - before.camera().position_world).eval();
  };
  // A Gaussian would have the rest moved in proportion.
  const double near = moveByOneOff(1.0).norm();
  EXPECT_LT(moveByOneOff(12.0).norm(), 0.5 * 12.0 * near);
  EXPECT_LT(moveByOneOff(40.0).norm(), 0.5 * moveByOneOff(12.0).norm());
}

constexpr double kInterval_s = 1.0 / 30.0;

/// A camera among points of a map, and the true state, which is drawn from the filter's prior.
class RobustUpdateTest : public ::testing::Test {
 protected:
  /// `sigma_point_m` of the map decides how redundant the measurements are.
  void makeScene(double sigma_point_m, const FilterOptions& options) {
    Ekf filter(options);
    filter.reset(exampleCamera(random_), 1e-5 * Eigen::Matrix<double, 12, 12>::Identity());
    for (int i = 0; i < 40; ++i) {
      const double depth = random_.uniform(1.0, 3.0);
      filter.addPointFeature(
          filter.camera().poseWorldCamera() * (depth * *model_.unproject(random_.pixel())),
          sigma_point_m * sigma_point_m * Eigen::Matrix3d::Identity());
    }
    impulse_ = impulseRoot(filter, kInterval_s);
    filter.predict(kInterval_s);
    prior_ = filter;
    root_ = symmetricRoot(prior_.covariance());
  }

  static FilterOptions exactlyCalibrated() {
    FilterOptions options = exampleOptions();
    options.initial_sigma_readout_s = options.initial_sigma_focal = 0.0;
    options.initial_sigma_radial = options.initial_sigma_centre = 0.0;
    return options;
  }

  /// Of a truth that differs from the prior's mean by a draw from its covariance and by `surprise`.
  std::vector<FeatureMeasurement> draw(double sigma_px, const Eigen::VectorXd& surprise) {
    Eigen::VectorXd error(prior_.stateSize());
    for (double& e : error) e = random_.normal();
    error = root_ * error + surprise;
    truth_ = prior_.camera();
    std::vector<FeatureState> features = prior_.features();
    applyError(error, truth_, features);
    std::vector<FeatureMeasurement> measurements;
    for (const FeatureState& feature : features) {
      const double du = random_.normal(sigma_px), dv = random_.normal(sigma_px);
      const auto projection = projectFeature(model_, truth_, feature);
      if (projection && projectIn(prior_, model_, *prior_.find(feature.id)))
        measurements.push_back({feature.id, projection->pixel + Eigen::Vector2d(du, dv)});
    }
    return measurements;
  }
  std::vector<FeatureMeasurement> draw(double sigma_px) {
    return draw(sigma_px, Eigen::VectorXd::Zero(prior_.stateSize()));
  }

  Ekf updated(const std::vector<FeatureMeasurement>& measurements, const NoisePrior& noise,
              UpdateReport* report) const {
    Ekf filter = prior_;
    *report = filter.update(model_, measurements, noise);
    EXPECT_TRUE(report->healthy);
    return filter;
  }

  double poseNees(const Ekf& filter) const {
    Eigen::Matrix<double, 6, 1> error;
    error << truth_.position_world - filter.camera().position_world,
        vectorFromRotation(truth_.q_world_camera * filter.camera().q_world_camera.conjugate());
    return error.dot(filter.cameraCovariance().topLeftCorner<6, 6>().ldlt().solve(error));
  }

  const CameraModel model_{exampleCalibration()};
  Random random_{1};
  Ekf prior_{exampleOptions()};
  Eigen::MatrixXd root_, impulse_;
  CameraState truth_;
};

constexpr double kWellKnown_m = 5e-4, kPoorlyKnown_m = 5e-3;

TEST_F(RobustUpdateTest, NoiseScaleIsOneOnAverageWhereRIsRight) {
  for (const double sigma_point_m : {kWellKnown_m, kPoorlyKnown_m}) {
    makeScene(sigma_point_m, exactlyCalibrated());
    double mean = 0.0, redundancy = 0.0;
    constexpr int kRuns = 400;
    for (int run = 0; run < kRuns; ++run) {
      UpdateReport report;
      const auto measurements = draw(1.0);
      updated(measurements, {}, &report);
      mean += report.noise_scale / kRuns;
      redundancy += report.noise_degrees / (2.0 * report.used) / kRuns;
    }
    EXPECT_NEAR(mean, 1.0, 0.03) << "of redundancy " << redundancy;
  }
}

TEST_F(RobustUpdateTest, NoiseScaleIsTheVarianceFactorWhereRIsWrong) {
  makeScene(kWellKnown_m, exactlyCalibrated());
  for (const double k : {0.25, 4.0}) {
    double mean = 0.0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      UpdateReport report;
      updated(draw(std::sqrt(k)), {0.0}, &report);
      mean += report.noise_scale / kRuns;
    }
    EXPECT_NEAR(mean, k, 0.1 * k);
  }
}

TEST_F(RobustUpdateTest, NoiseScalesOfSuccessiveImagesConvergeWhereRedundancyIsLower) {
  makeScene(2e-3, exactlyCalibrated());
  for (const double k : {0.25, 4.0}) {
    double variance_px2 = 1.0;
    for (int image = 0; image < 12; ++image) {
      constexpr int kRuns = 40;
      double mean = 0.0;
      for (int run = 0; run < kRuns; ++run) {
        auto measurements = draw(std::sqrt(k));
        for (FeatureMeasurement& m : measurements) m.sigma_px = std::sqrt(variance_px2);
        UpdateReport report;
        updated(measurements, {0.0}, &report);
        mean += report.noise_scale / kRuns;
      }
      variance_px2 *= mean;
    }
    EXPECT_NEAR(variance_px2, k, 0.1 * k);
  }
}

TEST_F(RobustUpdateTest, ASurpriseOfTheMotionIsNotTakenForNoise) {
  FilterOptions options = exactlyCalibrated();
  options.sigma_acceleration_mps2 = 7.0;
  options.sigma_angular_acceleration_rps2 = 12.0;
  makeScene(kWellKnown_m, options);
  Random signs(3);
  double ordinary = 0.0, surprised = 0.0, nis = 0.0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    UpdateReport report;
    updated(draw(1.0), {}, &report);
    ordinary += report.noise_scale / kRuns;
    Eigen::Matrix<double, 6, 1> sigmas;
    for (double& s : sigmas) s = signs.normal() < 0.0 ? -4.0 : 4.0;
    updated(draw(1.0, impulse_ * sigmas), {}, &report);
    surprised += report.noise_scale / kRuns;
    nis += report.nis / (2 * report.used) / kRuns;
  }
  EXPECT_GT(nis, 1.8) << "of each degree of freedom: the innovation shows it";
  EXPECT_NEAR(surprised, ordinary, 0.1);
}

TEST_F(RobustUpdateTest, CovarianceIsRightForGaussianErrors) {
  makeScene(kWellKnown_m, exactlyCalibrated());
  for (const double degrees : {std::numeric_limits<double>::infinity(), 0.0}) {
    constexpr int kRuns = 1000;
    double nees = 0.0;
    for (int run = 0; run < kRuns; ++run) {
      UpdateReport report;
      const auto measurements = draw(1.0);
      nees += poseNees(updated(measurements, {degrees}, &report)) / kRuns;
    }
    const auto [low, high] = meanChiSquareBounds(kRuns, 6);
    EXPECT_GT(nees, low);
    EXPECT_LT(nees, high);
  }
}

TEST_F(RobustUpdateTest, InfiniteDegreesLeaveRAndFiniteOnesGoWithTheResidualsByTheirShare) {
  makeScene(kWellKnown_m, exactlyCalibrated());
  for (const double k : {0.25, 4.0}) {
    const auto measurements = draw(std::sqrt(k));
    UpdateReport report, all;
    const auto variance = [&](const NoisePrior& noise, UpdateReport* r) {
      return updated(measurements, noise, r).cameraCovariance().topLeftCorner<6, 6>().trace();
    };
    const double known = variance({}, &report);
    EXPECT_NEAR(variance({1e12}, &report), known, 1e-6 * known);
    const double by_residuals = variance({0.0}, &all);
    const double between = variance({all.noise_degrees}, &report);
    EXPECT_GT(between, std::min(known, by_residuals));
    EXPECT_LT(between, std::max(known, by_residuals));

    // As if the posterior mean of the scale had been known before.
    const double mean = (all.noise_degrees + report.noise_degrees * report.noise_scale) /
                        (all.noise_degrees + report.noise_degrees);
    auto with_scale = measurements;
    for (FeatureMeasurement& m : with_scale) m.sigma_px = std::sqrt(mean);
    const double expected =
        updated(with_scale, {}, &all).cameraCovariance().topLeftCorner<6, 6>().trace();
    EXPECT_NEAR(between, expected, 0.05 * expected);
  }
}

TEST_F(RobustUpdateTest, TheScaleHasALowerBound) {
  makeScene(kWellKnown_m, exactlyCalibrated());
  const auto measurements = draw(0.01);
  UpdateReport report;
  const Ekf bounded = updated(measurements, {0.0, 0.25}, &report);
  auto with_bound = measurements;
  for (FeatureMeasurement& m : with_bound) m.sigma_px = 0.5;
  const Ekf expected = updated(with_bound, {}, &report);
  EXPECT_LT(relativeDifference(bounded.covariance(), expected.covariance()), 1e-3);
}

}  // namespace
}  // namespace active_matching_slam
