#include "active_matching_slam/evaluation/final_trajectory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "active_matching_slam/evaluation/run_report.h"
#include "evaluation/test_trajectories.h"

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// A camera among points all of which it matches, in a map that moves as `drift` says: where the
/// map's world has gone until a frame.
class DriftingRun {
 public:
  static constexpr int kFrames = 40, kPoints = 30;
  template <typename Drift>
  explicit DriftingRun(const Drift& drift) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> side(-2.0, 2.0);
    for (int i = 0; i < kPoints; ++i)
      points.emplace_back(side(random), side(random), 4.0 + side(random));
    poses = randomTrajectory(kFrames);
    for (int i = 0; i < kFrames; ++i) {
      const Isometry3d T_map_world = drift(i);
      auto frame = TrackedFrame();
      frame.index = i;
      frame.stamp_s = poses[static_cast<std::size_t>(i)].stamp_s;
      frame.image = cv::Mat(1, 1, CV_8UC1, cv::Scalar(0));
      frame.state = TrackingState::kTracking;
      const Isometry3d pose = T_map_world * poses[static_cast<std::size_t>(i)].T_world_camera;
      frame.camera.setPoseWorldCamera(pose);
      for (int k = 0; k < kPoints; ++k) {
        TrackedFeature feature;
        feature.id = k;
        feature.kind = FeatureKind::kPoint;
        feature.position_world = T_map_world * points[static_cast<std::size_t>(k)];
        feature.status = FeatureStatus::kMatched;
        frame.features.push_back(feature);
      }
      frames.push_back(frame);
    }
  }
  Trajectory finalPoses() const {
    FinalTrajectory final;
    for (const TrackedFrame& frame : frames) final.add(frame);
    return final.poses();
  }
  /// Largest distance from the true pose, as the map that ends with `T_map_world` has it.
  double error(const Trajectory& trajectory, const Isometry3d& T_map_world) const {
    double largest = trajectory.size() == poses.size() ? 0.0 : 1e9;
    for (std::size_t i = 0; i < trajectory.size() && i < poses.size(); ++i) {
      const Isometry3d expected = T_map_world * poses[i].T_world_camera;
      largest = std::max(
          largest,
          (trajectory[i].T_world_camera.matrix() - expected.matrix()).cwiseAbs().maxCoeff());
    }
    return largest;
  }

  std::vector<Vector3d> points;
  Trajectory poses;
  std::vector<TrackedFrame> frames;
};

Isometry3d driftOf(double metres) {
  Isometry3d T = Isometry3d::Identity();
  T.translation() << metres, -0.5 * metres, 0.2 * metres;
  T.rotate(Eigen::AngleAxisd(0.3 * metres, Vector3d::UnitY()));
  return T;
}

TEST(FinalTrajectory, OfAMapThatStaysIsWhatItWas) {
  const DriftingRun run([](int) { return driftOf(0.0); });
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.0)), 1e-6);
}

TEST(FinalTrajectory, GoesWithTheMap) {
  // A drift that grows, and that a loop takes out in the end.
  const auto drift = [](int i) { return driftOf(i == DriftingRun::kFrames - 1 ? 0.0 : 0.01 * i); };
  const DriftingRun run(drift);
  Trajectory told;
  for (const TrackedFrame& frame : run.frames)
    told.push_back({frame.stamp_s, frame.camera.poseWorldCamera()});
  EXPECT_GT(run.error(told, driftOf(0.0)), 0.1);
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.0)), 1e-5);
}

TEST(FinalTrajectory, FramesWithoutFeaturesThatAreLeftGoWithTheirNeighbours) {
  DriftingRun run([](int i) { return driftOf(i == DriftingRun::kFrames - 1 ? 0.1 : 0.0); });
  for (int i = 10; i < 20; ++i)
    for (TrackedFeature& feature : run.frames[static_cast<std::size_t>(i)].features)
      feature.id += 1000;
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.1)), 0.01);
}

TEST(FinalTrajectory, AFeatureThatMovedByItselfHardlyCounts) {
  DriftingRun run([](int) { return driftOf(0.0); });
  for (int k = 0; k < 4; ++k)
    run.frames.back().features[static_cast<std::size_t>(k)].position_world +=
        Vector3d(1.0, 0.5, 0.0);
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.0)), 0.02);
}

TEST(FinalTrajectory, FeaturesThatWereLaidAsideCount) {
  DriftingRun run([](int i) { return driftOf(i == DriftingRun::kFrames - 1 ? 0.0 : 0.1); });
  auto frozen = std::make_shared<FrozenMap>();
  for (const TrackedFeature& feature : run.frames.back().features)
    frozen->features.push_back({feature.id, 0, false, feature.position_world});
  run.frames.back().frozen = frozen;
  run.frames.back().features.clear();
  Trajectory final = run.finalPoses();
  final.pop_back();  // it matched nothing
  run.poses.pop_back();
  EXPECT_LT(run.error(final, driftOf(0.0)), 1e-5);
}

TEST(FinalTrajectory, AnotherUnitOfLengthCountsFromTheBeginning) {
  DriftingRun run([](int) { return driftOf(0.0); });
  TrackedFrame& last = run.frames.back();
  last.rescaled_by = 2.0;
  last.camera.position_world *= 2.0;
  for (TrackedFeature& feature : last.features) feature.position_world *= 2.0;
  for (StampedPose& pose : run.poses) pose.T_world_camera.translation() *= 2.0;
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.0)), 1e-5);
}

TEST(FinalTrajectory, WhatWasSeenInAMapThatWasTakenBackDoesNotCount) {
  DriftingRun run([](int i) { return driftOf(i >= 20 && i < 30 ? 0.5 : 0.0); });
  for (int i = 20; i < 30; ++i) {
    TrackedFrame& frame = run.frames[static_cast<std::size_t>(i)];
    frame.loops = 1;
    // Numbers that go to other features afterwards.
    std::reverse(frame.features.begin(), frame.features.end());
    for (std::size_t k = 0; k < frame.features.size(); ++k)
      frame.features[k].id = static_cast<FeatureId>(k);
    frame.camera.setPoseWorldCamera(run.poses[static_cast<std::size_t>(i)].T_world_camera);
  }
  EXPECT_LT(run.error(run.finalPoses(), driftOf(0.0)), 1e-5);
}

TEST(FinalTrajectory, OfAnotherMapNothingIsLeft) {
  DriftingRun run([](int) { return driftOf(0.0); });
  run.frames.back().map = 1;
  EXPECT_EQ(run.finalPoses().size(), 1u);
  EXPECT_TRUE(FinalTrajectory().poses().empty());
}

TEST(Resection, NeedsEnoughPoints) {
  const std::vector<Vector3d> points(5, Vector3d::UnitZ());
  EXPECT_FALSE(resect(points, points, Isometry3d::Identity()));
  const std::vector<Vector3d> same(10, Vector3d::UnitZ());  // do not tell
  EXPECT_FALSE(resect(same, same, Isometry3d::Identity()));
}

}  // namespace
}  // namespace active_matching_slam
