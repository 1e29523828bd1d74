#include "../../src/tracker/map_joiner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

/// Of the other map's world and unit: a point x of the one is at unit * (turned x + shift) there.
constexpr double kOtherUnit = 1.6;

FilterOptions allBecomePoints() {
  FilterOptions options;
  options.linearity_threshold = 10.0;
  return options;
}

/// Two maps of one wall of relief, made independently, each of points of its own, and the two
/// filters' cameras, found by the noisy pixels of one image.
struct TwoMaps {
  CameraModel camera{makeSimulatedCalibration(640, 480, "none")};
  Ekf map{allBecomePoints()}, other{allBecomePoints()};
  Eigen::Isometry3d T_map_camera = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_other_map = Eigen::Isometry3d::Identity();  ///< lengths then times unit
  std::vector<FeatureMeasurement> sights;                         ///< of the map's points
  std::vector<FeatureId> others;
  std::vector<Eigen::Vector3d> truth;  ///< of the other's points, in the map's world

  explicit TwoMaps(unsigned seed) : random(seed) {
    T_map_camera.translation() << 0.3, -0.2, 0.1;
    T_map_camera.linear() = rotationFromVector({0.1, -0.2, 0.3}).toRotationMatrix();
    T_other_map.translation() << -2.0, 1.0, 0.5;
    T_other_map.linear() = rotationFromVector({-0.4, 0.9, 0.2}).toRotationMatrix();
    sights = fill(&map, Eigen::Isometry3d::Identity(), 1.0, nullptr);
    fill(&other, T_other_map, kOtherUnit, &others);
  }

 private:
  Eigen::Vector3d noise(double sigma) { return {draw(sigma), draw(sigma), draw(sigma)}; }
  double draw(double sigma) { return std::normal_distribution<double>(0.0, sigma)(random); }

  /// Points that the camera sees, in a world and a unit, and the camera by their pixels.
  std::vector<FeatureMeasurement> fill(Ekf* filter, const Eigen::Isometry3d& T_world_map,
                                       double unit, std::vector<FeatureId>* ids) {
    constexpr double kPointSigma = 0.03, kPixelSigma = 0.5;
    Eigen::Isometry3d T_world_camera = T_world_map * T_map_camera;
    T_world_camera.translation() *= unit;
    Eigen::Matrix<double, 12, 1> sigma;
    sigma << Eigen::Vector3d::Constant(0.1 * unit), Eigen::Vector3d::Constant(0.05),
        Eigen::Matrix<double, 6, 1>::Constant(0.1);
    CameraState start;
    Eigen::Isometry3d about = T_world_camera;
    about.translation() += noise(0.01 * unit);  // a pose by the same pixels, which is all but free
    about.linear() = rotationFromVector(noise(0.003)).toRotationMatrix() * about.linear();
    start.setPoseWorldCamera(about);
    filter->reset(start, sigma.cwiseAbs2().asDiagonal());
    std::vector<FeatureMeasurement> measurements;
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector2d pixel(60.0 + 70.0 * (i % 8) + draw(12.0), 60.0 + 85.0 * (i / 8));
      const double depth = 2.0 + 0.5 * std::sin(0.01 * pixel.x());
      const Eigen::Vector3d point = T_map_camera * (depth * *camera.unproject(pixel));
      const Eigen::Vector3d there = unit * (T_world_map * point);
      const double point_sigma = kPointSigma * unit;
      const FeatureId id = filter->addPointFeature(
          there + noise(point_sigma), point_sigma * point_sigma * Eigen::Matrix3d::Identity());
      measurements.push_back({id, pixel + noise(kPixelSigma).head<2>(), kPixelSigma});
      if (!ids) continue;
      ids->push_back(id);
      truth.push_back(point);
    }
    filter->update(camera, measurements);
    return measurements;
  }

  std::mt19937 random;
};

/// Squared distance of joined points from the truth by the filter's covariance, a degree of
/// freedom: of each point by itself, and of all together.
struct JoinedErrors {
  double each = 0.0, all = 0.0;
};

JoinedErrors joinedErrors(const TwoMaps& maps, const UnitRatio& unit) {
  Ekf filter = maps.map;
  const int first = filter.stateSize();
  const JoinedFeatures joined = joinFeatures(maps.other, maps.others, unit, &filter);
  const auto n = static_cast<Eigen::Index>(joined.ids.size());
  EXPECT_EQ(filter.convertToPoints().size(), joined.ids.size());
  EXPECT_EQ(joined.ids, maps.others);
  Eigen::VectorXd error(3 * n);
  JoinedErrors errors;
  for (Eigen::Index i = 0; i < n; ++i) {
    const FeatureState& feature =
        filter.features()[filter.features().size() - static_cast<std::size_t>(n - i)];
    error.segment<3>(3 * i) = feature.position() - maps.truth[static_cast<std::size_t>(i)];
    const Eigen::Vector3d own = error.segment<3>(3 * i);
    errors.each +=
        own.dot(filter.positionCovariance(feature).ldlt().solve(own)) / (3.0 * double(n));
  }
  const Eigen::MatrixXd P = filter.covariance().block(first, first, 3 * n, 3 * n);
  errors.all = error.dot(P.ldlt().solve(error)) / (3.0 * double(n));
  return errors;
}

TEST(MapJoiner, UnitsAreComparedByWhatIsInViewOfBothMaps) {
  constexpr int kSeeds = 20;
  double squared = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const TwoMaps maps(seed);
    const auto unit = unitRatio(maps.camera, maps.map, maps.other, maps.sights);
    ASSERT_TRUE(unit);
    EXPECT_NEAR(unit->factor * kOtherUnit, 1.0, 0.1);
    const double error = std::log(unit->factor * kOtherUnit) / unit->log_sigma;
    squared += error * error / kSeeds;
  }
  std::cout << "squared errors of the ratio " << squared << "\n";
  EXPECT_LT(squared, 2.0) << "the truth is as near as is claimed";
  const TwoMaps maps(1);
  const std::vector<FeatureMeasurement> few(maps.sights.begin(), maps.sights.begin() + 3);
  EXPECT_FALSE(unitRatio(maps.camera, maps.map, maps.other, few));
}

TEST(MapJoiner, JoinedPointsAreAsFarOffAsTheirCovarianceSays) {
  constexpr int kSeeds = 30;
  JoinedErrors mean;
  double each_by_wrong_unit = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const TwoMaps maps(seed);
    const auto unit = unitRatio(maps.camera, maps.map, maps.other, maps.sights);
    ASSERT_TRUE(unit);
    const JoinedErrors errors = joinedErrors(maps, *unit);
    mean.each += errors.each / kSeeds;
    mean.all += errors.all / kSeeds;
    const JoinedErrors wrong = joinedErrors(maps, {1.15 * unit->factor, 1e-4});
    each_by_wrong_unit += wrong.each / kSeeds;
  }
  EXPECT_LT(mean.each, 1.3);
  EXPECT_GT(mean.each, 0.4) << "nor much less sure than they are";
  EXPECT_LT(mean.all, 1.3);
  EXPECT_GT(mean.all, 0.4);
  EXPECT_GT(each_by_wrong_unit, 2.0) << "a unit that is wrong, and said to be known, shows";
  RecordProperty("each", std::to_string(mean.each));
  RecordProperty("all", std::to_string(mean.all));
  std::cout << "squared errors a degree of freedom: each point " << mean.each << ", all together "
            << mean.all << ", by a wrong unit " << each_by_wrong_unit << "\n";
}

/// Rays and a point, seen from where the camera is no more.
Ekf mapOfRays(const CameraModel& camera) {
  Ekf map{FilterOptions()};
  CameraState start;
  start.velocity_world = {0.6, -0.3, 0.2};
  start.angular_velocity_camera = {0.1, -0.2, 0.1};
  map.reset(start, 1e-4 * MotionCovariance::Identity());
  map.addInverseDepthFeature(camera, {200.0, 150.0}, 0.4, 0.1);
  map.predict(0.5);
  map.addInverseDepthFeature(camera, {400.0, 300.0}, 0.5, 0.2);
  map.addPointFeature({0.4, 0.2, 2.5}, 1e-3 * Eigen::Matrix3d::Identity());
  map.predict(0.5);
  return map;
}

TEST(MapJoiner, FirstOrderErrorsAreThoseOfMapsThatDifferALittle) {
  const CameraModel camera(makeSimulatedCalibration(640, 480, "none"));
  const Ekf other = mapOfRays(camera);
  const UnitRatio unit{1.7, 0.0};
  std::vector<FeatureId> ids;
  for (const FeatureState& feature : other.features()) ids.push_back(feature.id);
  CameraState place;
  place.setPoseWorldCamera(TwoMaps(1).T_map_camera);
  const auto join = [&](const Ekf& map) {
    Ekf filter{FilterOptions()};
    filter.reset(place, 1e-18 * MotionCovariance::Identity());
    joinFeatures(map, ids, unit, &filter);
    return filter;
  };
  const Ekf joined = join(other);
  ASSERT_EQ(joined.features().size(), ids.size());
  Eigen::MatrixXd J(3 * ids.size(), other.stateSize());
  constexpr double kStep = 1e-6;
  for (int column = 0; column < other.stateSize(); ++column) {
    Eigen::VectorXd delta = Eigen::VectorXd::Zero(other.stateSize());
    delta[column] = kStep;
    CameraState moved = other.camera();
    std::vector<FeatureState> features = other.features();
    applyError(delta, moved, features);
    Ekf differing = other;
    differing.restore(moved, features, other.savedCovariance(), other.nextId());
    const Ekf result = join(differing);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const FeatureState &was = joined.features()[i], &is = result.features()[i];
      const auto row = 3 * static_cast<Eigen::Index>(i);
      J.block<2, 1>(row, column) =
          was.tangentBasis().transpose() * (is.bearing_world - was.bearing_world) / kStep;
      J(row + 2, column) = (is.inverse_depth - was.inverse_depth) / kStep;
    }
  }
  const Eigen::MatrixXd expected = J * other.covariance() * J.transpose();
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t k = 0; k < ids.size(); ++k) {
      const Eigen::Matrix3d own = joined.covariance().block<3, 3>(
          joined.features()[i].bearingRow(), joined.features()[k].bearingRow());
      const Eigen::Matrix3d numeric = expected.block<3, 3>(3 * i, 3 * k);
      EXPECT_LT((own - numeric).norm(), 1e-5 * expected.norm()) << i << " " << k;
    }
}

TEST(MapJoiner, ThePosesOfWhatComesAlongAreTakenOver) {
  const TwoMaps maps(2);
  Ekf filter = maps.map;
  const Eigen::Isometry3d camera_in_other = maps.other.camera().poseWorldCamera();
  const JoinedFeatures joined =
      joinFeatures(maps.other, maps.others, {1.0 / kOtherUnit, 0.05}, &filter);
  EXPECT_TRUE(joined(camera_in_other).isApprox(maps.map.camera().poseWorldCamera(), 1e-9))
      << "the two cameras are one";
  EXPECT_EQ(filter.camera().position_world, maps.map.camera().position_world);
  EXPECT_EQ(filter.features().size(), maps.map.features().size() + maps.others.size());
  EXPECT_EQ(filter.covariance().topLeftCorner(maps.map.stateSize(), maps.map.stateSize()),
            maps.map.covariance());
  for (const FeatureId id : joined.ids) EXPECT_NE(maps.other.find(id), nullptr);
}

TEST(MapJoiner, TwoLooksAgreeWhereTheCameraMovedAsItWasTracked) {
  const TwoMaps maps(3);
  Eigen::Isometry3d T_first_second = Eigen::Isometry3d::Identity();
  T_first_second.translation() << 0.1, 0.0, 0.05;
  T_first_second.linear() = rotationFromVector({0.0, 0.1, 0.0}).toRotationMatrix();
  const auto lookAt = [&](const Eigen::Isometry3d& T_world_camera) {
    Relocalisation found;
    found.T_world_camera = T_world_camera;
    found.inliers = maps.sights;
    found.rms_px = 0.7;
    return found;
  };
  const Eigen::Isometry3d T_first = maps.map.camera().poseWorldCamera();
  const Relocalisation first = lookAt(T_first), second = lookAt(T_first * T_first_second);
  Eigen::Isometry3d tracked = T_first_second;
  tracked.translation() *= kOtherUnit;
  EXPECT_TRUE(agree(maps.camera, maps.map, first, second, tracked, {1.0 / kOtherUnit, 0.05}));
  Eigen::Isometry3d turned = tracked;
  turned.linear() = tracked.linear() * rotationFromVector({0.05, 0.0, 0.0}).toRotationMatrix();
  EXPECT_FALSE(agree(maps.camera, maps.map, first, second, turned, {1.0 / kOtherUnit, 0.05}));
  Eigen::Isometry3d farther = tracked;
  farther.translation() *= 4.0;
  EXPECT_FALSE(agree(maps.camera, maps.map, first, second, farther, {1.0 / kOtherUnit, 0.05}));
}

}  // namespace
}  // namespace active_matching_slam
