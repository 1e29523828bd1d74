#include "active_matching_slam/evaluation/trajectory_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluation/test_trajectories.h"

namespace active_matching_slam {
namespace {

std::vector<PosePair> pairsOf(const Trajectory& estimate, const Trajectory& truth) {
  std::vector<PosePair> pairs = pairPoses(estimate, truth, 1e-6);
  EXPECT_EQ(pairs.size(), truth.size());
  return pairs;
}

TEST(Align, RecoversAKnownSimilarity) {
  const Trajectory estimate = randomTrajectory(100);
  const Eigen::Vector3d t(3.0, -1.0, 0.5);
  const auto pairs = pairsOf(estimate, transformed(estimate, 2.5, someRotation(), t));
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(alignment->scale, 2.5, 1e-12);
  EXPECT_TRUE(alignment->rotation_truth_estimate.isApprox(someRotation(), 1e-12));
  EXPECT_LT((alignment->translation - t).norm(), 1e-12);
  EXPECT_LT(absoluteTrajectoryError(pairs, *alignment), 1e-12);
  for (const PosePair& pair : pairs)
    EXPECT_TRUE(
        (*alignment)(pair.T_world_camera_estimate).isApprox(pair.T_world_camera_truth, 1e-10));
}

TEST(Align, RigidAlignmentKeepsTheScaleError) {
  const Trajectory estimate = randomTrajectory(100);
  const auto pairs = pairsOf(estimate, transformed(estimate, 1.1, someRotation(), {1, 2, 3}));
  const auto alignment = align(pairs, AlignmentKind::kRigid);
  ASSERT_TRUE(alignment);
  EXPECT_EQ(alignment->scale, 1.0);
  // What remains is a tenth of the spread about the mean.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : estimate) mean += pose.T_world_camera.translation() / 100.0;
  double spread = 0.0;
  for (const StampedPose& pose : estimate)
    spread += (pose.T_world_camera.translation() - mean).squaredNorm() / 100.0;
  EXPECT_NEAR(absoluteTrajectoryError(pairs, *alignment), 0.1 * std::sqrt(spread), 1e-10);
}

TEST(Align, NoSmallChangeOfTheAlignmentLowersTheError) {
  const Trajectory truth = randomTrajectory(80);
  Trajectory estimate = transformed(truth, 0.7, someRotation(), {1, 1, 1});
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 0.05);
  for (StampedPose& pose : estimate)
    pose.T_world_camera.translation() +=
        Eigen::Vector3d(noise(random), noise(random), noise(random));
  const auto pairs = pairsOf(estimate, truth);
  for (const AlignmentKind kind : {AlignmentKind::kRigid, AlignmentKind::kSimilarity}) {
    const Alignment best = *align(pairs, kind);
    const double least = absoluteTrajectoryError(pairs, best);
    for (int k = 0; k < 3; ++k) {
      for (const double step : {-1e-3, 1e-3}) {
        Alignment other = best;
        other.translation(k) += step;
        EXPECT_GT(absoluteTrajectoryError(pairs, other), least);
        other = best;
        other.rotation_truth_estimate =
            Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(k)) * best.rotation_truth_estimate;
        EXPECT_GT(absoluteTrajectoryError(pairs, other), least);
        other = best;
        other.scale += step;
        if (kind == AlignmentKind::kSimilarity) {
          EXPECT_GT(absoluteTrajectoryError(pairs, other), least);
        }
      }
    }
  }
}

TEST(Align, AMirroredTrajectoryIsNotAReflectionAway) {
  const Trajectory truth = randomTrajectory(100);
  Trajectory mirrored = truth;
  for (StampedPose& pose : mirrored) pose.T_world_camera.translation().x() *= -1.0;
  const auto alignment = align(pairsOf(mirrored, truth), AlignmentKind::kSimilarity);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(alignment->rotation_truth_estimate.determinant(), 1.0, 1e-12);
}

TEST(Align, MotionAlongALineStillHasItsError) {
  Trajectory truth = randomTrajectory(60);
  for (StampedPose& pose : truth)
    pose.T_world_camera.translation() = pose.stamp_s * Eigen::Vector3d(1, 2, 3);
  const auto pairs = pairsOf(transformed(truth, 0.5, someRotation(), {1, 0, 0}), truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(alignment->rotation_truth_estimate.determinant(), 1.0, 1e-9);
  EXPECT_LT(absoluteTrajectoryError(pairs, *alignment), 1e-9);
}

TEST(Align, WhatIsNotDeterminedIsEmpty) {
  const Trajectory truth = randomTrajectory(10);
  EXPECT_FALSE(align({}, AlignmentKind::kRigid));
  EXPECT_FALSE(align(pairPoses({truth[0], truth[1]}, truth), AlignmentKind::kRigid));
  Trajectory still = truth;
  for (StampedPose& pose : still) pose.T_world_camera.translation() << 1, 2, 3;
  EXPECT_FALSE(align(pairsOf(still, truth), AlignmentKind::kSimilarity));
  EXPECT_FALSE(align(pairsOf(truth, still), AlignmentKind::kSimilarity));
  EXPECT_TRUE(align(pairsOf(still, truth), AlignmentKind::kRigid));
  Trajectory broken = truth;
  broken[4].T_world_camera.translation().y() = NAN;
  EXPECT_FALSE(align(pairsOf(broken, truth), AlignmentKind::kRigid));
}

TEST(AbsoluteTrajectoryError, IsTheRootMeanSquareDistance) {
  std::vector<PosePair> pairs(2);
  pairs[0].T_world_camera_truth.translation() << 3, 0, 0;
  pairs[1].T_world_camera_truth.translation() << 0, 4, 0;
  EXPECT_DOUBLE_EQ(absoluteTrajectoryError(pairs, Alignment()), std::sqrt((9.0 + 16.0) / 2.0));
  EXPECT_TRUE(std::isnan(absoluteTrajectoryError({}, Alignment())));
}

TEST(RelativePoseError, IsBlindToTheWorldFrame) {
  const Trajectory truth = randomTrajectory(100);
  const auto error =
      relativePoseError(pairsOf(transformed(truth, 1.0, someRotation(), {1, 2, 3}), truth));
  ASSERT_TRUE(error);
  EXPECT_EQ(error->intervals, 70);
  EXPECT_LT(error->translation_rmse, 1e-12);
  EXPECT_LT(error->rotation_rmse_rad, 1e-7);
}

TEST(RelativePoseError, ConstantDriftShowsPerInterval) {
  Trajectory truth = randomTrajectory(100);
  for (StampedPose& pose : truth) pose.T_world_camera.linear().setIdentity();
  Trajectory estimate = truth;
  for (StampedPose& pose : estimate) pose.T_world_camera.translation().x() += 0.02 * pose.stamp_s;
  EXPECT_NEAR(relativePoseError(pairsOf(estimate, truth), 1.0)->translation_rmse, 0.02, 1e-9);
  EXPECT_NEAR(relativePoseError(pairsOf(estimate, truth), 2.0)->translation_rmse, 0.04, 1e-9);
}

TEST(RelativePoseError, ConstantTurnShowsPerInterval) {
  const Trajectory truth = randomTrajectory(100);
  Trajectory estimate = truth;
  for (StampedPose& pose : estimate)  // in the world, so positions stay the truth's
    pose.T_world_camera.linear() =
        Eigen::AngleAxisd(0.05 * pose.stamp_s, Eigen::Vector3d::UnitZ()) *
        pose.T_world_camera.linear();
  EXPECT_NEAR(relativePoseError(pairsOf(estimate, truth))->rotation_rmse_rad, 0.05, 1e-9);
}

TEST(RelativePoseError, FreeScaleIsTakenOutFirst) {
  const Trajectory truth = randomTrajectory(100);
  const auto pairs = pairsOf(transformed(truth, 0.25, someRotation(), {1, 2, 3}), truth);
  EXPECT_GT(relativePoseError(pairs)->translation_rmse, 0.1);
  EXPECT_LT(relativePoseError(pairs, 1.0, 4.0)->translation_rmse, 1e-12);
}

TEST(RelativePoseError, ARunShorterThanTheIntervalHasNone) {
  const Trajectory truth = randomTrajectory(20);
  EXPECT_FALSE(relativePoseError(pairsOf(truth, truth), 1.0));
  EXPECT_FALSE(relativePoseError({}, 1.0));
}

TEST(RelativePoseError, GapsInTimeAreNotBridged) {
  Trajectory truth = randomTrajectory(100);
  for (std::size_t i = 15; i < truth.size(); ++i) truth[i].stamp_s += 100.0;
  const auto error = relativePoseError(pairsOf(truth, truth), 1.0);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->intervals, 55);
}

}  // namespace
}  // namespace active_matching_slam
