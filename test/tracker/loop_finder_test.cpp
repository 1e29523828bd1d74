#include "../../src/tracker/loop_finder.h"

#include <gtest/gtest.h>

#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/submaps/ekf_active_map.h"

namespace active_matching_slam {
namespace {

constexpr double kDriftM = 0.3, kDriftRad = 0.05;

/// Points of a submap that hang on four of the filter's, and a camera which has drifted from them.
struct DriftedCamera {
  CameraModel camera{makeSimulatedCalibration(640, 480, "none")};
  Ekf filter{FilterOptions()};
  Conditional points;
  Relocalisation found;
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();

  /// `offset`: of the true camera from the estimated one, in standard deviations of the drift.
  explicit DriftedCamera(double offset) {
    Eigen::Matrix<double, 12, 1> sigma;
    sigma << Eigen::Vector3d::Constant(kDriftM), Eigen::Vector3d::Constant(kDriftRad),
        Eigen::Matrix<double, 6, 1>::Constant(0.1);
    filter.reset(CameraState(), sigma.cwiseAbs2().asDiagonal());
    truth.translation() << offset * kDriftM, 0.0, 0.0;
    truth.linear() = rotationFromVector({0.0, offset * kDriftRad, 0.0}).toRotationMatrix();
    std::vector<FeatureId> separator;
    for (int i = 0; i < 4; ++i)
      separator.push_back(filter.addPointFeature({i % 2 - 0.5, i / 2 - 0.5, 4.0},
                                                 1e-6 * Eigen::Matrix3d::Identity()));
    const PointGaussian active = activePoints(filter);
    points.given_ids = separator;
    points.given_mean = active.mean;
    constexpr int kCount = 20;
    points.mean.resize(3 * kCount);
    points.K = Eigen::MatrixXd::Zero(3 * kCount, active.mean.size());
    points.Q = 1e-6 * Eigen::MatrixXd::Identity(3 * kCount, 3 * kCount);
    for (int i = 0; i < kCount; ++i) {
      const Eigen::Vector3d point(0.4 * (i % 5) - 0.8, 0.4 * (i / 5) - 0.6, 3.0 + 0.1 * (i % 3));
      points.ids.push_back(100 + i);
      points.mean.segment<3>(3 * i) = point;
      for (int k = 0; k < 4; ++k)
        points.K.block<3, 3>(3 * i, active.firstRow(k)) = 0.25 * Eigen::Matrix3d::Identity();
      if (const auto pixel = camera.project(truth.inverse() * point))
        found.inliers.push_back({100 + i, *pixel, 0.0});
    }
    found.T_world_camera = truth;
    found.rms_px = 0.8;
  }
};

TEST(LoopFinder, ADriftThatTheFilterKnowsOfIsExpectedAndALargerOneIsNot) {
  const auto offsetAt = [](double sigmas) {
    const DriftedCamera drifted(sigmas);
    return offsetFromSubmap(drifted.filter, drifted.camera, drifted.points, drifted.found);
  };
  EXPECT_TRUE(offsetAt(0.0).isExpected());
  EXPECT_NEAR(offsetAt(0.0).squared, 0.0, 1e-9);
  // Of position and rotation one sigma each; the camera found is known far better.
  EXPECT_NEAR(offsetAt(1.0).squared, 2.0, 0.05);
  EXPECT_TRUE(offsetAt(3.0).isExpected());  // 18 of 6 degrees of freedom
  EXPECT_FALSE(offsetAt(5.0).isExpected());
}

TEST(LoopFinder, ASubmapThatMovesWithTheCameraSaysNothingOfADrift) {
  DriftedCamera drifted(3.0);
  // All that is uncertain is where both are: then they can't be apart.
  Ekf filter{FilterOptions()};
  filter.reset(CameraState(), 1e-8 * MotionCovariance::Identity());
  for (const FeatureState& feature : drifted.filter.features())
    filter.addPointFeature(feature.point_world, 1e-8 * Eigen::Matrix3d::Identity());
  std::vector<FeatureId> all;
  for (const FeatureState& feature : filter.features()) all.push_back(feature.id);
  Eigen::Matrix<double, 6, 6> common = Eigen::Matrix<double, 6, 6>::Zero();
  common.diagonal().head<3>().setOnes();
  loosenCamera(common, all, &filter);
  const CameraOffset offset =
      offsetFromSubmap(filter, drifted.camera, drifted.points, drifted.found);
  EXPECT_GT(filter.covariance()(0, 0), 0.9);
  EXPECT_LT(offset.predicted.diagonal().maxCoeff(), 1e-4);
  EXPECT_FALSE(offset.isExpected());
}

TEST(LoopFinder, ASecondImageConfirmsADriftAndNotAMistake) {
  const DriftedCamera drifted(8.0);
  const CameraOffset offset =
      offsetFromSubmap(drifted.filter, drifted.camera, drifted.points, drifted.found);
  ASSERT_FALSE(offset.isExpected());
  const Eigen::Isometry3d predicted = drifted.filter.camera().poseWorldCamera();
  LoopWitness witness;
  EXPECT_FALSE(witness.confirms(10, predicted, drifted.found, offset));
  EXPECT_FALSE(witness.confirms(10, predicted, drifted.found, offset)) << "the same image";
  // The camera goes on, and so does the one that the submap shows.
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.translation() << 0.1, 0.0, 0.2;
  Relocalisation next = drifted.found;
  next.T_world_camera = drifted.found.T_world_camera * step;
  EXPECT_TRUE(witness.confirms(14, predicted * step, next, offset));

  Relocalisation wrong = next;
  wrong.T_world_camera.translation() += Eigen::Vector3d(0.4, 0.0, 0.0);
  LoopWitness other;
  EXPECT_FALSE(other.confirms(10, predicted, drifted.found, offset));
  EXPECT_FALSE(other.confirms(14, predicted * step, wrong, offset));
  other.clear();
  EXPECT_FALSE(other.confirms(18, predicted * step, next, offset));
}

TEST(LoopFinder, NoSecondImageConfirmsWhatNoDriftExplains) {
  const auto isConfirmed = [](double sigmas) {
    const DriftedCamera drifted(sigmas);
    const CameraOffset offset =
        offsetFromSubmap(drifted.filter, drifted.camera, drifted.points, drifted.found);
    const Eigen::Isometry3d predicted = drifted.filter.camera().poseWorldCamera();
    LoopWitness witness;
    witness.confirms(10, predicted, drifted.found, offset);
    return witness.confirms(14, predicted, drifted.found, offset);
  };
  EXPECT_TRUE(isConfirmed(8.0));
  EXPECT_FALSE(isConfirmed(30.0)) << "a place that only looks the same";
}

TEST(LoopFinder, WhatIsLoosenedMovesWithTheCameraAsABody) {
  DriftedCamera drifted(0.0);
  Ekf& filter = drifted.filter;
  const Eigen::MatrixXd before = filter.covariance();
  const FeatureId carried = filter.features()[1].id;
  Eigen::Matrix<double, 6, 6> added = Eigen::Matrix<double, 6, 6>::Zero();
  added(4, 4) = 0.01;  // a turn about the y axis
  loosenCamera(added, {carried}, &filter);
  const Eigen::MatrixXd more = filter.covariance() - before;
  const FeatureState& feature = *filter.find(carried);
  // It goes by y x p, where the camera stays.
  const Eigen::Vector3d way =
      Eigen::Vector3d::UnitY().cross(feature.point_world - filter.camera().position_world);
  EXPECT_TRUE((more.block<3, 3>(feature.offset, feature.offset))
                  .isApprox(0.01 * way * way.transpose(), 1e-9));
  EXPECT_TRUE(
      (more.block<3, 1>(feature.offset, CameraError::kRotation + 1)).isApprox(0.01 * way, 1e-9));
  EXPECT_EQ(more(CameraError::kPosition, CameraError::kPosition), 0.0);
  const FeatureState& other = filter.features()[2];
  EXPECT_TRUE(more.middleRows<3>(other.offset).isZero(0.0));
}

}  // namespace
}  // namespace active_matching_slam
