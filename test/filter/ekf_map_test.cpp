#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "active_matching_slam/filter/ekf.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

class EkfMap : public ::testing::Test {
 protected:
  const CameraModel model_{exampleCalibration()};
};

TEST_F(EkfMap, PredictionEqualsThePlainFormulaWithANumericalJacobian) {
  const Ekf before = exampleFilter(model_, 1);
  Ekf filter = before;
  const double dt = 0.13, step = 1e-4;
  filter.predict(dt);
  const int n = before.stateSize();

  // Motion of the mean perturbed by the camera's error and by the impulses, from the equations.
  constexpr int kCamera = CameraError::kSize, kAll = kCamera + 6;
  const auto moved = [&](const Eigen::VectorXd& d) {
    CameraState camera = before.camera();
    std::vector<FeatureState> none;
    applyError(d.head<kCamera>(), camera, none);
    camera.velocity_world += d.segment<3>(kCamera);
    camera.angular_velocity_camera += d.segment<3>(kCamera + 3);
    camera.position_world += camera.velocity_world * dt;
    camera.q_world_camera =
        camera.q_world_camera * rotationFromVector(camera.angular_velocity_camera * dt);
    return errorBetween(filter.camera(), none, camera, none, kCamera);
  };
  Eigen::MatrixXd J(kCamera, kAll);
  for (int i = 0; i < kAll; ++i) {
    const Eigen::VectorXd d = step * Eigen::VectorXd::Unit(kAll, i);
    J.col(i) = (moved(d) - moved(-d)) / (2.0 * step);
  }
  EXPECT_LT(moved(Eigen::VectorXd::Zero(kAll)).norm(), 1e-14) << "mean";
  Eigen::MatrixXd F = Eigen::MatrixXd::Identity(n, n);
  F.topLeftCorner<kCamera, kCamera>() = J.leftCols<kCamera>();
  Eigen::Matrix<double, 6, 6> Q = Eigen::Matrix<double, 6, 6>::Identity();
  Q *= dt * dt;  // both accelerations are 1 here
  Eigen::MatrixXd P = F * before.covariance() * F.transpose();
  P.topLeftCorner<kCamera, kCamera>() += J.rightCols<6>() * Q * J.rightCols<6>().transpose();
  EXPECT_LT((filter.covariance() - P).norm(), 1e-8 * P.norm());
  EXPECT_EQ(filter.covariance(), filter.covariance().transpose().eval());
  // The calibration is no motion: nothing of it or of what it has in common with the map changes.
  const Eigen::MatrixXd calibration = before.covariance().bottomRightCorner(n - 12, n - 12);
  ASSERT_GT(calibration.topRightCorner(5, n - kCamera).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_EQ(filter.covariance().bottomRightCorner(n - 12, n - 12), calibration);
}

TEST_F(EkfMap, PredictionOverNoTimeOrNonsenseChangesNothing) {
  const Ekf before = exampleFilter(model_, 2);
  for (const double dt : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    Ekf filter = before;
    filter.predict(dt);
    filter.addLandmarkNoise(model_, dt, 1.0);
    EXPECT_EQ(filter.covariance(), before.covariance());
    EXPECT_EQ(filter.camera().position_world, before.camera().position_world);
  }
}

/// With inverse depths and a point.
Ekf filterWithAPoint(const CameraModel& model) {
  Ekf filter = exampleFilter(model, 3);
  filter.addPointFeature(filter.camera().poseWorldCamera() * Eigen::Vector3d(0.3, -0.2, 1.5),
                         1e-4 * Eigen::Matrix3d::Identity());
  return filter;
}

TEST_F(EkfMap, ALoosenedLandmarkIsThatMuchLessCertainInTheImageAndNoOther) {
  Ekf filter = filterWithAPoint(model_);
  std::vector<FeatureId> ids;
  for (const FeatureState& feature : filter.features()) ids.push_back(feature.id);
  const double sigma_px = 0.4;
  const FeatureId loosened = ids.back();
  const Eigen::MatrixXd before = filter.predictMeasurements(model_, ids, 0.0).S;
  filter.loosenLandmark(model_, loosened, sigma_px);
  filter.loosenLandmark(model_, ids.back() + 1, sigma_px);  // nobody's
  const auto after = filter.predictMeasurements(model_, ids, 0.0);
  const Eigen::MatrixXd growth = after.S - before;
  const Eigen::Index last = growth.rows() - 2;
  ASSERT_EQ(after.ids.back(), loosened);
  // Pixels are smaller angles away from the image centre.
  EXPECT_NEAR(std::sqrt(growth.block<2, 2>(last, last).determinant()), sigma_px * sigma_px,
              0.25 * sigma_px * sigma_px);
  EXPECT_LT(growth.topLeftCorner(last, last).norm(), 1e-9);
}

TEST_F(EkfMap, LandmarkNoiseIsARandomWalkAcrossTheRayByTheAngleOfTheView) {
  Ekf filter = filterWithAPoint(model_);
  const double sigma_px = 2.0;
  const double dt = 1e-4;
  const Eigen::MatrixXd before = filter.covariance();
  filter.addLandmarkNoise(model_, dt, sigma_px);
  Eigen::MatrixXd growth = filter.covariance() - before;
  const Eigen::Vector3d here = filter.camera().position_world;
  const Eigen::Vector3d there = here - dt * filter.camera().velocity_world;
  int points = 0, rays = 0;
  for (const FeatureState& feature : filter.features()) {
    const Eigen::Vector3d ray = (feature.position() - here).normalized();
    const double turned_rad = ray.cross((feature.position() - there).normalized()).norm();
    const double sigma_rad = sigma_px / model_.calibration().fx;
    const double variance = sigma_rad * sigma_rad * turned_rad;
    auto own = growth.block(feature.offset, feature.offset, feature.size(), feature.size());
    if (feature.kind == FeatureKind::kPoint) {
      ++points;
      own /= (feature.position() - here).squaredNorm();
      EXPECT_LT((own * ray).norm(), 1e-6 * variance);
      EXPECT_NEAR(own.trace(), 2.0 * variance, 1e-3 * variance);
    } else {
      ++rays;
      auto bearing = own.diagonal().segment<2>(feature.bearingRow() - feature.offset);
      EXPECT_NEAR(bearing[0], variance, 1e-3 * variance);
      EXPECT_NEAR(bearing[1], variance, 1e-3 * variance);
      bearing.setZero();
      EXPECT_TRUE(own.isZero(0.0));
    }
    own.setZero();
  }
  EXPECT_TRUE(growth.isZero(0.0)) << "the rest";
  EXPECT_GT(points, 0);
  EXPECT_GT(rays, 0);
}

TEST_F(EkfMap, LandmarkNoiseIsNoneWithoutASigmaOrAMotion) {
  const Ekf before = filterWithAPoint(model_);
  for (const double sigma_px : {0.0, -1.0, std::nan("")}) {
    Ekf filter = before;
    filter.addLandmarkNoise(model_, 0.1, sigma_px);
    EXPECT_EQ(filter.covariance(), before.covariance());
  }
  Ekf still = before;
  still.decayVelocity(0.0);
  const Eigen::MatrixXd P = still.covariance();
  still.addLandmarkNoise(model_, 0.1, 2.0);
  EXPECT_EQ(still.covariance(), P);
}

TEST_F(EkfMap, ANewFeatureIsPredictedWhereItWasSeenWhateverItsDepth) {
  // A doubtful row would add its place times the doubtful depth, a term of second order.
  FilterOptions options = exampleOptions();
  options.initial_sigma_readout_s = 0.0;
  CameraState another_lens;
  another_lens.lens = poorlyCalibratedCamera().lens;
  for (const CameraState& calibration : {CameraState(), another_lens}) {
    Ekf filter = exampleFilter(model_, 3, 6, calibration, options);
    Random random(3);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d pixel = random.pixel();
      const FeatureId id = filter.addInverseDepthFeature(model_, pixel, random.uniform(0.01, 2.0));
      ASSERT_GE(id, 0);
      const PredictedMeasurements predicted = filter.predictMeasurements(model_, {id});
      EXPECT_LT((predicted.z - pixel).norm(), 1e-6);
      // The camera's error cancels: what is left is the pixel's noise, at first sight and now.
      EXPECT_LT((predicted.S - 2.0 * Eigen::Matrix2d::Identity()).norm(), 1e-5);
    }
  }
}

TEST_F(EkfMap, ANewFeatureIsFullyCorrelatedWithTheCamera) {
  for (const CameraState& calibration : {CameraState(), poorlyCalibratedCamera()}) {
    const Ekf before = exampleFilter(model_, 4, 6, calibration);
    Ekf filter = before;
    const Eigen::Vector2d pixel(200.0, 300.0);
    const FeatureId id = filter.addInverseDepthFeature(model_, pixel, 0.4, 0.2);
    const FeatureState& feature = *filter.find(id);
    const int n = before.stateSize();
    // Numerical Jacobian of (anchor, bearing, rho) by camera, pixel and rho.
    constexpr int kCamera = CameraError::kSize;
    const auto created = [&](const Eigen::VectorXd& d) {
      CameraState camera = before.camera();
      std::vector<FeatureState> none;
      applyError(d.head<kCamera>(), camera, none);
      Eigen::VectorXd error(6);
      const RowPose row = poseOfRow(model_, camera, pixel.y() + d[kCamera + 1]);
      const Eigen::Vector3d bearing =
          row.R_world_camera *
          *model_.corrected(camera.lens).unproject(pixel + Eigen::Vector2d(d.segment<2>(kCamera)));
      error << row.position_world - feature.anchor_world,
          feature.tangentBasis().transpose() * (bearing - feature.bearing_world), d[kCamera + 2];
      return error;
    };
    Eigen::MatrixXd J(6, kCamera + 3);
    for (int i = 0; i < J.cols(); ++i) {
      const double step = i >= kCamera && i < kCamera + 2 ? 1e-2 : 1e-5;
      const Eigen::VectorXd d = step * Eigen::VectorXd::Unit(J.cols(), i);
      J.col(i) = (created(d) - created(-d)) / (2.0 * step);
    }
    Eigen::MatrixXd grow = Eigen::MatrixXd::Zero(n + 6, n + 3);
    grow.topLeftCorner(n, n).setIdentity();
    grow.bottomLeftCorner<6, kCamera>() = J.leftCols<kCamera>();
    grow.bottomRightCorner<6, 3>() = J.rightCols<3>();
    Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(n + 3, n + 3);
    joint.topLeftCorner(n, n) = before.covariance();
    joint.bottomRightCorner<3, 3>() = Eigen::Vector3d(1.0, 1.0, 0.04).asDiagonal();
    const Eigen::MatrixXd P = grow * joint * grow.transpose();
    // Variances of pixels and of the small rest: each by its own size.
    const Eigen::VectorXd sigma = P.diagonal().cwiseSqrt();
    const Eigen::MatrixXd error =
        (filter.covariance() - P).cwiseQuotient(sigma * sigma.transpose());
    EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((filter.covariance() - P).norm(), 1e-8 * P.norm());
    EXPECT_EQ(filter.covariance(), filter.covariance().transpose().eval());
  }
}

TEST_F(EkfMap, AFreshCalibrationIsAsUncertainAsTheOptionsSay) {
  FilterOptions options = exampleOptions();
  options.initial_sigma_readout_s = 0.02;
  options.initial_sigma_focal = 0.03;
  options.initial_sigma_radial = 0.04;
  options.initial_sigma_centre = 0.05;
  Ekf filter = exampleFilter(model_, 11, 6, CameraState(), options);
  Random random(11);
  const Eigen::Matrix<double, 12, 12> motion = exampleCameraCovariance(random);
  filter.reset(poorlyCalibratedCamera(), motion);
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(CameraError::kSize, CameraError::kSize);
  P.topLeftCorner<12, 12>() = motion;
  P.diagonal().tail<5>() << 4e-4, 9e-4, 16e-4, 25e-4, 25e-4;
  EXPECT_LT((filter.covariance() - P).norm(), 1e-15);
  EXPECT_EQ(filter.camera().readout_s, poorlyCalibratedCamera().readout_s);
  EXPECT_EQ(filter.camera().lens.centre, poorlyCalibratedCamera().lens.centre);
}

TEST_F(EkfMap, FeaturesThatCanNotBeUnprojectedAreRefused) {
  Ekf filter = exampleFilter(model_, 5);
  const int size = filter.stateSize();
  EXPECT_EQ(filter.addInverseDepthFeature(model_, Eigen::Vector2d(std::nan(""), 1.0)), -1);
  EXPECT_EQ(filter.stateSize(), size);
}

TEST_F(EkfMap, RemovingKeepsTheRestOfTheCovariance) {
  const Ekf before = exampleFilter(model_, 6);
  Ekf filter = before;
  const std::vector<FeatureId> ids = idsOf(before);
  ASSERT_GT(ids.size(), 8u);
  filter.removeFeatures({ids[7], 4711, ids[0], ids[3], ids[3], ids.back()});
  ASSERT_EQ(filter.features().size(), ids.size() - 4);
  int offset = CameraError::kSize;
  for (const FeatureState& a : filter.features()) {
    EXPECT_EQ(a.offset, offset);
    offset += a.size();
    const FeatureState& was_a = *before.find(a.id);
    EXPECT_EQ(a.position(), was_a.position());
    EXPECT_EQ(filter.covariance().block(0, a.offset, CameraError::kSize, a.size()),
              before.covariance().block(0, was_a.offset, CameraError::kSize, a.size()));
    for (const FeatureState& b : filter.features()) {
      EXPECT_EQ(
          filter.covariance().block(a.offset, b.offset, a.size(), b.size()),
          before.covariance().block(was_a.offset, before.find(b.id)->offset, a.size(), b.size()));
    }
  }
  EXPECT_EQ(offset, filter.stateSize());
  EXPECT_EQ(filter.find(ids[0]), nullptr);
}

TEST_F(EkfMap, PointsThatWereTakenOutComeBackAsTheyWere) {
  Ekf filter = exampleFilter(model_, 3, 8);
  const Ekf before = filter;
  std::vector<FeatureState> points;
  std::vector<FeatureId> ids;
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind != FeatureKind::kPoint || feature.id % 3 == 0) continue;
    points.push_back(feature);
    ids.push_back(feature.id);
  }
  ASSERT_GE(points.size(), 3u);
  filter.removeFeatures(ids);
  const auto rows = 3 * static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXd own(rows, rows), cross(rows, filter.stateSize());
  const auto P = before.covariance();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i);
    for (std::size_t j = 0; j < points.size(); ++j)
      own.block<3, 3>(row, 3 * static_cast<Eigen::Index>(j)) =
          P.block<3, 3>(points[i].offset, points[j].offset);
    cross.block(row, 0, 3, CameraError::kSize) =
        P.block(points[i].offset, 0, 3, CameraError::kSize);
    for (const FeatureState& other : filter.features())
      cross.block(row, other.offset, 3, other.size()) =
          P.block(points[i].offset, before.find(other.id)->offset, 3, other.size());
  }
  EXPECT_THROW(filter.insertFeatures(points, own, cross.leftCols(5)), std::invalid_argument);
  std::vector<FeatureState> unknown = points;
  unknown.back().id = filter.nextId();
  EXPECT_THROW(filter.insertFeatures(unknown, own, cross), std::invalid_argument);
  filter.insertFeatures(points, own, cross);
  EXPECT_EQ(filter.covariance(), before.covariance());
  for (std::size_t i = 0; i < before.features().size(); ++i) {
    EXPECT_EQ(filter.features()[i].id, before.features()[i].id);
    EXPECT_EQ(filter.features()[i].offset, before.features()[i].offset);
    EXPECT_EQ(filter.features()[i].position(), before.features()[i].position());
  }
  EXPECT_THROW(filter.insertFeatures(points, own, cross), std::invalid_argument);
}

TEST_F(EkfMap, IdsAreNeverUsedAgain) {
  Ekf filter(exampleOptions());
  filter.reset(CameraState(), 1e-4 * Eigen::Matrix<double, 12, 12>::Identity());
  const FeatureId first = filter.addInverseDepthFeature(model_, Eigen::Vector2d(100.0, 100.0));
  filter.removeFeatures({first});
  const FeatureId second = filter.addInverseDepthFeature(model_, Eigen::Vector2d(100.0, 100.0));
  filter.reset(CameraState(), 1e-4 * Eigen::Matrix<double, 12, 12>::Identity());
  EXPECT_EQ(filter.stateSize(), CameraError::kSize);
  const FeatureId third =
      filter.addPointFeature(Eigen::Vector3d(0.0, 0.0, 1.0), 1e-4 * Eigen::Matrix3d::Identity());
  EXPECT_LT(first, second);
  EXPECT_LT(second, third);
}

TEST_F(EkfMap, GrowingPastTheReservedRoomKeepsEverything) {
  Ekf filter = exampleFilter(model_, 7);
  Random random(7);
  Eigen::MatrixXd before = filter.covariance();
  for (int i = 0; i < 60; ++i) {
    filter.addInverseDepthFeature(model_, random.pixel());
    const int n = static_cast<int>(before.rows());
    ASSERT_EQ(filter.covariance().topLeftCorner(n, n), before);
    before = filter.covariance();
  }
}

TEST_F(EkfMap, AKnownPointIsIndependentOfTheRest) {
  Ekf filter = exampleFilter(model_, 8);
  const int n = filter.stateSize();
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-4, 2e-4, 3e-4).asDiagonal();
  const FeatureId id = filter.addPointFeature(Eigen::Vector3d(1.0, 2.0, 3.0), covariance);
  EXPECT_EQ(filter.positionCovariance(*filter.find(id)), covariance);
  EXPECT_EQ(filter.covariance().block(n, 0, 3, n), Eigen::MatrixXd::Zero(3, n));
  EXPECT_EQ(filter.find(id)->position(), Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST_F(EkfMap, ConvertsWellKnownDepthsOnlyAndWithTheProperJacobian) {
  Ekf filter = exampleFilter(model_, 9);
  filter.convertToPoints();  // what is well known already
  const FeatureId sharp =
      filter.addInverseDepthFeature(model_, Eigen::Vector2d(200.0, 150.0), 0.5, 0.005);
  const FeatureId vague =
      filter.addInverseDepthFeature(model_, Eigen::Vector2d(400.0, 250.0), 0.5, 0.02);
  const FeatureState feature = *filter.find(sharp);
  const Eigen::MatrixXd P = filter.covariance();
  // L = 4 sigma_rho / rho at first sight: 0.04 and 0.16 against the threshold of 0.1.
  const std::vector<FeatureId> converted = filter.convertToPoints();
  EXPECT_EQ(converted, std::vector<FeatureId>{sharp});
  EXPECT_EQ(filter.find(sharp)->kind, FeatureKind::kPoint);
  EXPECT_EQ(filter.find(vague)->kind, FeatureKind::kInverseDepth);
  EXPECT_LT((filter.find(sharp)->position() - feature.position()).norm(), 1e-14);

  const int n = static_cast<int>(P.rows());
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(n, n);
  for (int i = 0; i < 6; ++i) {
    const auto moved = [&](double step) -> Eigen::Vector3d {
      CameraState camera;
      std::vector<FeatureState> features{feature};
      applyError(step * Eigen::VectorXd::Unit(n, feature.offset + i), camera, features);
      return features[0].position();
    };
    T.block<3, 1>(feature.offset, feature.offset + i) = (moved(1e-5) - moved(-1e-5)) / 2e-5;
  }
  const Eigen::MatrixXd full = T * P * T.transpose();
  const int o = feature.offset;
  Eigen::MatrixXd expected(n - 3, n - 3);  // the vague feature comes last
  expected << full.topLeftCorner(o + 3, o + 3), full.topRightCorner(o + 3, 6),
      full.bottomLeftCorner(6, o + 3), full.bottomRightCorner(6, 6);
  ASSERT_EQ(filter.stateSize(), n - 3);
  EXPECT_LT((filter.covariance() - expected).norm(), 1e-7 * expected.norm());
  EXPECT_EQ(filter.covariance(), filter.covariance().transpose().eval());
}

TEST_F(EkfMap, ConvertsTheFeaturesItIsAskedFor) {
  Ekf filter = exampleFilter(model_, 9);
  filter.convertToPoints();
  const FeatureId sharp =
      filter.addInverseDepthFeature(model_, Eigen::Vector2d(200.0, 150.0), 0.5, 0.005);
  const FeatureId vague =
      filter.addInverseDepthFeature(model_, Eigen::Vector2d(400.0, 250.0), 0.5, 0.02);
  Ekf by_index = filter, none = filter;
  ASSERT_EQ(by_index.convertToPoints(), std::vector<FeatureId>{sharp});
  filter.convertToPoints({sharp});
  EXPECT_EQ(filter.covariance(), by_index.covariance());
  const Eigen::Matrix3d covariance = filter.positionCovariance(*filter.find(vague));
  const FeatureId other = filter.features().front().id;
  filter.convertToPoints({vague, other, 1000});  // a point and an unknown one besides
  EXPECT_EQ(filter.find(vague)->kind, FeatureKind::kPoint);
  EXPECT_LT((filter.positionCovariance(*filter.find(vague)) - covariance).norm(),
            1e-12 * covariance.norm());
  none.convertToPoints({});
  EXPECT_EQ(none.find(vague)->kind, FeatureKind::kInverseDepth);
}

/// The same filter with rows for anchors at the origin too, about which nothing is uncertain.
Ekf withAllAnchors(const Ekf& filter) {
  std::vector<FeatureState> features = filter.features();
  std::vector<int> place;  // of every row
  for (int i = 0; i < CameraError::kSize; ++i) place.push_back(i);
  int size = CameraError::kSize;
  for (FeatureState& feature : features) {
    const int more = feature.anchored_at_origin ? 3 : 0;
    for (int i = 0; i < feature.size(); ++i) place.push_back(size + more + i);
    size += feature.size() + more;
    feature.anchored_at_origin = false;
  }
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(size, size);
  for (int j = 0; j < filter.stateSize(); ++j)
    for (int i = 0; i < filter.stateSize(); ++i) P(place[i], place[j]) = filter.covariance()(i, j);
  Ekf all(filter.options());
  all.restore(filter.camera(), features, P, filter.nextId());
  return all;
}

TEST_F(EkfMap, AnAnchorAtTheOriginIsOneOfWhichNothingIsUncertain) {
  Ekf filter(exampleOptions());
  filter.reset(poorlyCalibratedCamera(), 1e-3 * Eigen::Matrix<double, 12, 12>::Identity());
  Random random(11);
  startFromOrigin(model_, 12, random, &filter);
  Ekf all = withAllAnchors(filter);
  ASSERT_EQ(all.stateSize(), filter.stateSize() + 3 * 12);
  std::size_t converted = 0, added = 0;
  for (int frame = 0; frame < 30; ++frame) {
    if (frame == 5) {
      filter.rescale(1.5);
      all.rescale(1.5);
    }
    if (frame == 10) {
      filter.fixScale(1e-3);
      all.fixScale(1e-3);
    }
    for (Ekf* each : {&filter, &all}) {
      each->predict(0.1);
      each->addLandmarkNoise(model_, 0.1, 0.5);
    }
    const auto measurements = noisyMeasurements(filter, model_, 1.0, random);
    EXPECT_GT(filter.update(model_, measurements).used, 2);
    all.update(model_, measurements);
    if (frame % 4 == 0) {
      ++added;
      const Eigen::Vector2d pixel = random.pixel();
      filter.addInverseDepthFeature(model_, pixel);
      all.addInverseDepthFeature(model_, pixel);
    }
    const auto points = filter.convertToPoints();
    EXPECT_EQ(points, all.convertToPoints());
    converted += points.size();
    const Ekf expected = withAllAnchors(filter);
    ASSERT_EQ(expected.stateSize(), all.stateSize());
    EXPECT_LT((expected.covariance() - all.covariance()).norm(), 1e-9 * all.covariance().norm());
    EXPECT_LT(errorBetween(all.camera(), all.features(), filter.camera(), expected.features(),
                           all.stateSize())
                  .norm(),
              1e-9);
    for (const FeatureState& feature : filter.features()) {
      const FeatureState& same = *all.find(feature.id);
      EXPECT_NEAR(filter.sigmaInverseDepth(feature), all.sigmaInverseDepth(same), 1e-9);
      const Eigen::Matrix3d position = all.positionCovariance(same);
      EXPECT_LT((filter.positionCovariance(feature) - position).norm(), 1e-9 * position.norm());
    }
  }
  EXPECT_GT(converted, 3u);
  EXPECT_LT(converted, 12 + added);
}

TEST_F(EkfMap, RefusesAnAnchorThatIsNotAtTheOriginThoughItSaysSo) {
  Ekf filter(exampleOptions());
  filter.reset(CameraState(), 1e-3 * Eigen::Matrix<double, 12, 12>::Identity());
  Random random(12);
  startFromOrigin(model_, 1, random, &filter);
  std::vector<FeatureState> features = filter.features();
  features[0].anchor_world.x() = 1e-9;
  EXPECT_THROW(filter.restore(filter.camera(), features, filter.covariance(), 1),
               std::invalid_argument);
  features = filter.features();
  features[0].kind = FeatureKind::kPoint;
  EXPECT_THROW(filter.restore(filter.camera(), features, filter.covariance(), 1),
               std::invalid_argument);
}

TEST_F(EkfMap, RescalingTheMapKeepsWhatIsSeen) {
  Ekf filter = exampleFilter(model_, 10);
  const auto before = filter.predictMeasurements(model_, idsOf(filter));
  const Eigen::Vector3d position = filter.camera().position_world;
  const double sigma_z = std::sqrt(filter.covariance()(2, 2));
  filter.rescale(2.5);
  const auto after = filter.predictMeasurements(model_, idsOf(filter));
  EXPECT_LT((after.z - before.z).norm(), 1e-9 * before.z.norm());
  EXPECT_LT((after.S - before.S).norm(), 1e-9 * before.S.norm());
  EXPECT_LT((filter.camera().position_world - 2.5 * position).norm(), 1e-14);
  EXPECT_NEAR(std::sqrt(filter.covariance()(2, 2)), 2.5 * sigma_z, 1e-12);
  EXPECT_EQ(filter.covariance(), filter.covariance().transpose().eval());
  for (const double bad : {0.0, -1.0, std::nan("")})
    EXPECT_THROW(filter.rescale(bad), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
