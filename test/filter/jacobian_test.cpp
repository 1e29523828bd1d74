#include <gtest/gtest.h>

#include <cmath>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

constexpr double kStep = 1e-4;  // central differences of fourth order: error about 1e-11

/// d f / d x at 0 by five-point differences.
template <typename F>
Eigen::MatrixXd numericalJacobian(F f, int size) {
  const Eigen::VectorXd centre = f(Eigen::VectorXd::Zero(size));
  Eigen::MatrixXd J(centre.size(), size);
  for (int i = 0; i < size; ++i) {
    const auto at = [&](double step) -> Eigen::VectorXd {
      Eigen::VectorXd x = Eigen::VectorXd::Zero(size);
      x[i] = step;
      return f(x);
    };
    J.col(i) = (8.0 * (at(kStep) - at(-kStep)) - (at(2 * kStep) - at(-2 * kStep))) / (12.0 * kStep);
  }
  return J;
}

TEST(Rotation, VectorAndQuaternionAreInverse) {
  Random random(1);
  for (const double size : {0.0, 1e-12, 1e-5, 1e-3, 0.1, 1.0}) {
    const Eigen::Vector3d v = random.vector(size);
    EXPECT_LT((vectorFromRotation(rotationFromVector(v)) - v).norm(), 1e-14);
    Eigen::Quaterniond q = rotationFromVector(v);
    q.coeffs() = -q.coeffs();
    EXPECT_LT((vectorFromRotation(q) - v).norm(), 1e-14) << "sign of the quaternion";
  }
}

TEST(Rotation, LeftJacobianEqualsTheNumericalOne) {
  Random random(2);
  for (const double size : {0.0, 5e-4, 2e-3, 0.3, 1.5}) {
    const Eigen::Vector3d v = random.vector(size);
    const auto difference = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return vectorFromRotation(rotationFromVector(v + d) * rotationFromVector(v).conjugate());
    };
    EXPECT_LT((numericalJacobian(difference, 3) - leftJacobian(v)).norm(), 1e-9) << size;
  }
}

/// Compares all columns for all features, at their inverse depth, at infinity and beyond, as
/// `camera` sees them.
void expectNumericalJacobians(const CameraState& camera, double tolerance) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 3);
  const int size = filter.stateSize();
  int checked = 0;
  for (FeatureState feature : filter.features()) {
    for (const double inverse_depth : {feature.inverse_depth, 0.0, -0.05}) {
      feature.inverse_depth = inverse_depth;
      const auto projection = projectFeature(model.corrected(camera.lens), camera, feature);
      if (!projection) continue;
      const Eigen::MatrixXd J = numericalJacobian(
          [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
            CameraState moved = camera;
            std::vector<FeatureState> features{feature};
            applyError(d, moved, features);
            return projectFeature(model.corrected(moved.lens), moved, features[0])->pixel;
          },
          size);
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2, size);
      H.leftCols<CameraError::kSize>() = projection->d_camera;
      H.middleCols(feature.offset, feature.size()) = projection->d_feature.leftCols(feature.size());
      EXPECT_LT((J - H).norm(), tolerance * H.norm()) << feature.id << " rho " << inverse_depth;
      ++checked;
    }
  }
  EXPECT_GT(checked, 30);
}

TEST(MeasurementModel, JacobiansEqualTheNumericalOnes) {
  expectNumericalJacobians(exampleFilter(CameraModel(exampleCalibration()), 3).camera(), 1e-7);
}

TEST(MeasurementModel, JacobiansEqualTheNumericalOnesWhileTheImageRunsUnderARollingShutter) {
  CameraState camera = exampleFilter(CameraModel(exampleCalibration()), 3).camera();
  camera.readout_s = poorlyCalibratedCamera().readout_s;
  camera.lens = poorlyCalibratedCamera().lens;
  // Some 300 px/s up or down, which moves the row itself, and 500 px/s to the side. The row is
  // searched for a few times only, the derivative is that of the row at last.
  for (const double pitch : {-0.7, 0.7}) {
    camera.angular_velocity_camera = Eigen::Vector3d(pitch, 1.2, 0.3);
    expectNumericalJacobians(camera, 5e-5);
  }
}

TEST(MeasurementModel, TheStateIsThatOfTheMiddleRowAndTheOthersAreTheReadoutApart) {
  const CameraModel model(exampleCalibration());
  Random random(13);
  CameraState camera = exampleCamera(random);
  camera.readout_s = 0.03;
  const auto poseAt = [&](double v) {
    const RowPose row = poseOfRow(model, camera, v);
    Eigen::Isometry3d pose(row.R_world_camera);
    pose.pretranslate(row.position_world);
    return pose;
  };
  EXPECT_LT((poseAt(240.0).matrix() - camera.poseWorldCamera().matrix()).norm(), 1e-15);
  const Eigen::Isometry3d apart = poseAt(0.0).inverse() * poseAt(480.0);
  EXPECT_LT((poseAt(0.0).linear() * apart.translation() - 0.03 * camera.velocity_world).norm(),
            1e-15);
  EXPECT_LT((vectorFromRotation(Eigen::Quaterniond(apart.linear())) -
             0.03 * camera.angular_velocity_camera)
                .norm(),
            1e-15);
}

TEST(MeasurementModel, AFeatureIsSeenFromThePoseOfTheRowThatShowsIt) {
  const CameraModel model(exampleCalibration());
  CameraState camera = poorlyCalibratedCamera();
  camera.velocity_world = Eigen::Vector3d(0.3, -0.2, 0.4);
  camera.angular_velocity_camera = Eigen::Vector3d(0.7, 1.2, 0.3);
  const CameraModel lens = model.corrected(camera.lens);
  Random random(14);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d pixel = random.pixel();
    const RowPose row = poseOfRow(lens, camera, pixel.y());
    FeatureState feature;
    feature.kind = FeatureKind::kPoint;
    feature.point_world = row.position_world +
                          row.R_world_camera * (random.uniform(0.5, 5.0) * *lens.unproject(pixel));
    EXPECT_LT((projectFeature(lens, camera, feature)->pixel - pixel).norm(), 1e-3);
  }
}

TEST(MeasurementModel, SecondOrderNoiseIsTheVarianceOfWhatLinearisationLeavesOut) {
  Random random(12);
  FeatureProjection projection;
  for (int i = 0; i < 6; ++i) projection.d_ray.data()[i] = random.normal(1.0);
  Eigen::Matrix4d A;
  for (int i = 0; i < 16; ++i) A.data()[i] = random.normal(1.0);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  const int samples = 400000;
  for (int i = 0; i < samples; ++i) {
    Eigen::Vector4d x;
    for (int k = 0; k < 4; ++k) x[k] = random.normal(1.0);
    x = A * x;
    const Eigen::Vector2d left_out = projection.d_ray * x.head<3>() * x[3];
    mean += left_out / samples;
    square += left_out * left_out.transpose() / samples;
  }
  const Eigen::Matrix2d sampled = square - mean * mean.transpose();
  const Eigen::Matrix2d noise = secondOrderNoise(projection, A * A.transpose());
  EXPECT_LT((sampled - noise).norm(), 0.03 * noise.norm());
}

TEST(MeasurementModel, RelativeCovarianceIsThatOfTheDifferences) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 8);
  CovarianceMatrix P;
  P.reset(filter.stateSize());
  P.view() = filter.covariance();
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind != FeatureKind::kInverseDepth) continue;
    Eigen::MatrixXd D = Eigen::MatrixXd::Zero(4, filter.stateSize());
    D.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
    if (feature.hasAnchorError()) D.block<3, 3>(0, feature.offset).setIdentity();
    D(3, feature.inverseDepthRow()) = 1.0;
    const Eigen::Matrix4d expected = D * P.view() * D.transpose();
    EXPECT_LT((relativeCovariance(feature, P) - expected).norm(), 1e-12);
  }
}

TEST(MeasurementModel, StaysFiniteAtInfinityAndAgreesWithAFarPoint) {
  const CameraModel model(exampleCalibration());
  FeatureState feature;
  feature.bearing_world = Eigen::Vector3d(0.1, -0.2, 1.0).normalized();
  feature.tangent_world = feature.bearing_world.cross(Eigen::Vector3d::UnitY()).normalized();
  CameraState camera;
  camera.position_world = Eigen::Vector3d(1.0, 2.0, 0.5);
  const auto at_infinity = projectFeature(model, camera, feature);
  ASSERT_TRUE(at_infinity);
  FeatureState far;
  far.kind = FeatureKind::kPoint;
  far.point_world = 1e9 * feature.bearing_world;
  EXPECT_LT((projectFeature(model, camera, far)->pixel - at_infinity->pixel).norm(), 1e-5);
}

class Gauge : public ::testing::Test {
 protected:
  /// The filter's mean in a world turned by v[0..2] and grown by exp(v[3]).
  void transform(const Eigen::VectorXd& v, CameraState& camera,
                 std::vector<FeatureState>& features) const {
    const Eigen::Matrix3d turn =
        std::exp(v[3]) * rotationFromVector(v.head<3>()).toRotationMatrix();
    camera.position_world = turn * camera.position_world;
    camera.velocity_world = turn * camera.velocity_world;
    camera.q_world_camera = rotationFromVector(v.head<3>()) * camera.q_world_camera;
    for (FeatureState& feature : features) {
      feature.anchor_world = turn * feature.anchor_world;
      feature.bearing_world = rotationFromVector(v.head<3>()) * feature.bearing_world;
      feature.point_world = turn * feature.point_world;
      feature.inverse_depth *= std::exp(-v[3]);
    }
  }

  const CameraModel model_{exampleCalibration()};
  const Ekf filter_ = exampleFilter(model_, 4);
};

TEST_F(Gauge, GeneratorsAreTheDerivativeOfTurningAndScalingTheWorld) {
  const int size = filter_.stateSize();
  const auto transformed = [&](const Eigen::VectorXd& v) -> Eigen::VectorXd {
    CameraState camera = filter_.camera();
    std::vector<FeatureState> features = filter_.features();
    transform(v, camera, features);
    return errorBetween(filter_.camera(), filter_.features(), camera, features, size);
  };
  const Eigen::MatrixXd G = gaugeGenerators(filter_.camera(), filter_.features(), size);
  EXPECT_LT((numericalJacobian(transformed, 4) - G).norm(), 1e-7);
}

TEST_F(Gauge, FunctionalsReadOffTheirOwnFreedomAndNoTranslation) {
  const int size = filter_.stateSize();
  CovarianceMatrix P;
  P.reset(size);
  P.view() = filter_.covariance();
  const Eigen::MatrixXd L = gaugeFunctionals(filter_.camera(), filter_.features(), P);
  const Eigen::MatrixXd G = gaugeGenerators(filter_.camera(), filter_.features(), size);
  EXPECT_LT((L.transpose() * G - Eigen::Matrix4d::Identity()).norm(), 1e-12);
  Eigen::MatrixXd translation = Eigen::MatrixXd::Zero(size, 3);
  translation.middleRows<3>(CameraError::kPosition).setIdentity();
  for (const FeatureState& feature : filter_.features())
    if (!feature.anchored_at_origin) translation.middleRows<3>(feature.offset).setIdentity();
  EXPECT_LT((L.transpose() * translation).norm(), 1e-12);
}

TEST_F(Gauge, NoMeasurementTellsOfIt) {
  const int size = filter_.stateSize();
  const Eigen::MatrixXd G = gaugeGenerators(filter_.camera(), filter_.features(), size);
  MeasurementStack stack;
  for (const FeatureState& feature : filter_.features()) {
    const auto projection = projectFeature(model_, filter_.camera(), feature);
    if (projection) stack.add(feature, *projection);
  }
  ASSERT_GT(stack.rows(), 20);
  EXPECT_LT(stack.times(G).norm(), 1e-10);
}

TEST(StateError, AppliesToFirstOrderWhatItSays) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 5);
  const int size = filter.stateSize();
  const auto difference = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    CameraState camera = filter.camera();
    std::vector<FeatureState> features = filter.features();
    applyError(d, camera, features);
    return errorBetween(filter.camera(), filter.features(), camera, features, size);
  };
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(size, size);
  EXPECT_LT((numericalJacobian(difference, size) - I).norm(), 1e-8);
}

TEST(StateError, FollowsALargeTurnOfTheWholeWorldExactly) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 6);
  const int size = filter.stateSize();
  const Eigen::Vector3d turn_vector(0.4, -0.7, 0.5);
  const Eigen::Quaterniond turn = rotationFromVector(turn_vector);
  CameraState camera = filter.camera();
  std::vector<FeatureState> features = filter.features();
  applyError(gaugeGenerators(camera, features, size).leftCols<3>() * turn_vector, camera, features);
  EXPECT_LT((camera.position_world - turn * filter.camera().position_world).norm(), 1e-13);
  for (std::size_t i = 0; i < features.size(); ++i) {
    const FeatureState& before = filter.features()[i];
    if (before.kind == FeatureKind::kPoint) {
      EXPECT_LT((features[i].point_world - turn * before.point_world).norm(), 1e-12);
      continue;
    }
    EXPECT_LT((features[i].anchor_world - turn * before.anchor_world).norm(), 1e-13);
    EXPECT_LT((features[i].bearing_world - turn * before.bearing_world).norm(), 1e-13);
    EXPECT_LT((features[i].tangent_world - turn * before.tangent_world).norm(), 1e-13);
  }
}

TEST(StateError, LeavesKnownPlacesAloneHoweverTheCameraTurns) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 7);
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(filter.stateSize());
  delta.segment<3>(CameraError::kRotation) = Eigen::Vector3d(0.4, -0.7, 0.5);
  CameraState camera = filter.camera();
  std::vector<FeatureState> features = filter.features();
  applyError(delta, camera, features);
  for (std::size_t i = 0; i < features.size(); ++i) {
    const FeatureState& before = filter.features()[i];
    EXPECT_LT((features[i].point_world - before.point_world).norm(), 1e-14);
    EXPECT_LT((features[i].anchor_world - before.anchor_world).norm(), 1e-14);
    EXPECT_LT((features[i].bearing_world - before.bearing_world).norm(), 1e-14);
  }
}

}  // namespace
}  // namespace active_matching_slam
