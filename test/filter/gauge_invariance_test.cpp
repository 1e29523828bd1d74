#include <gtest/gtest.h>

#include "active_matching_slam/filter/ekf.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

/// A change of world: x -> scale * turn * x + shift.
struct Change {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double scale = 1.0;

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return scale * (turn * x) + shift; }
};

struct Run {
  std::vector<double> nis;
  Ekf filter;
};

/// The same images seen in a changed world: innovations, and the filter at the end.
Run runIn(const Change& change) {
  const CameraModel model(exampleCalibration());
  Random random(1);
  FilterOptions options = exampleOptions();
  options.sigma_acceleration_mps2 = 6.0;
  options.sigma_angular_acceleration_rps2 = 10.0;
  options.sigma_acceleration_mps2 *= change.scale;
  options.initial_inverse_depth /= change.scale;
  options.initial_sigma_inverse_depth /= change.scale;
  options.minimum_inverse_depth /= change.scale;
  Run run{{}, Ekf(options)};

  CameraState truth = exampleCamera(random);
  truth.velocity_world = Eigen::Vector3d(0.3, 0.1, -0.1);
  const Eigen::Matrix3d R = change.turn.toRotationMatrix();
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(12, 12);
  T.block<3, 3>(0, 0) = T.block<3, 3>(6, 6) = change.scale * R;
  T.block<3, 3>(3, 3) = R;
  CameraState start = truth;
  start.position_world = change(truth.position_world);
  start.velocity_world = change.scale * (R * truth.velocity_world);
  start.q_world_camera = change.turn * truth.q_world_camera;
  run.filter.reset(start, T * exampleCameraCovariance(random) * T.transpose());

  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 24; ++i) {
    const Eigen::Vector2d pixel = random.pixel();
    points.push_back(truth.poseWorldCamera() *
                     (random.uniform(1.0, 3.0) * *model.unproject(pixel)));
    if (i < 4) {
      run.filter.addPointFeature(change(points[i]),
                                 change.scale * change.scale * 1e-4 * Eigen::Matrix3d::Identity());
    } else {
      run.filter.addInverseDepthFeature(model, pixel);
    }
  }
  for (int frame = 0; frame < 60; ++frame) {
    const double dt = 1.0 / 15.0;
    truth.position_world += truth.velocity_world * dt;
    if (frame % 20 == 10) truth.velocity_world *= -1.0;
    truth.q_world_camera = truth.q_world_camera * rotationFromVector(random.vector(0.02));
    run.filter.predict(dt);
    std::vector<FeatureMeasurement> measurements;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto pixel = model.project(truth.poseWorldCamera().inverse() * points[i]);
      const double du = random.normal(), dv = random.normal();
      if (pixel && model.isInImage(*pixel))
        measurements.push_back({static_cast<FeatureId>(i), *pixel + Eigen::Vector2d(du, dv), 0.0});
    }
    run.nis.push_back(run.filter.update(model, measurements).nis);
    run.filter.convertToPoints();
  }
  return run;
}

void expectSameExceptForTheChange(const Change& change) {
  const Run plain = runIn(Change()), changed = runIn(change);
  ASSERT_EQ(plain.nis.size(), changed.nis.size());
  for (std::size_t i = 0; i < plain.nis.size(); ++i)
    EXPECT_NEAR(changed.nis[i], plain.nis[i], 1e-5 * plain.nis[i]) << i;
  const Eigen::Vector3d expected = change(plain.filter.camera().position_world);
  EXPECT_LT((changed.filter.camera().position_world - expected).norm(), 1e-6 * change.scale);
  EXPECT_LT((change.turn * plain.filter.camera().q_world_camera)
                .angularDistance(changed.filter.camera().q_world_camera),
            1e-6);
  ASSERT_EQ(plain.filter.stateSize(), changed.filter.stateSize());
  const Eigen::Matrix3d P = plain.filter.covariance().topLeftCorner<3, 3>();
  const Eigen::Matrix3d R = change.turn.toRotationMatrix();
  const Eigen::Matrix3d turned = change.scale * change.scale * R * P * R.transpose();
  EXPECT_LT((changed.filter.covariance().topLeftCorner<3, 3>() - turned).norm(),
            1e-5 * turned.norm());
}

TEST(GaugeInvariance, ATurnedWorldGivesTheSameInnovationsAndUncertainty) {
  Change change;
  change.turn = rotationFromVector(Eigen::Vector3d(0.5, -1.2, 2.0));
  expectSameExceptForTheChange(change);
}

TEST(GaugeInvariance, AShiftedWorldGivesTheSameInnovationsAndUncertainty) {
  Change change;
  change.shift = Eigen::Vector3d(3.0, -5.0, 2.0);
  expectSameExceptForTheChange(change);
}

TEST(GaugeInvariance, AWorldInOtherUnitsGivesTheSameInnovationsAndUncertainty) {
  Change change;
  change.scale = 7.0;
  expectSameExceptForTheChange(change);
}

}  // namespace
}  // namespace active_matching_slam
