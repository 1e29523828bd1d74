// The default configuration in a simulated room, against exact truth: accuracy of the poses as they
// were given out at the time, over every frame, and how honest their covariance is.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <tuple>

#include "active_matching_slam/evaluation/consistency.h"
#include "active_matching_slam/evaluation/trajectory_error.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

struct SimulatedRun {
  int frames = 0, first_untracked = -1;
  Trajectory tracked, truth;  ///< both begin at the identity
  std::vector<Eigen::Matrix<double, 6, 6>> covariances;
};

SimulatedRun trackSimulation(const std::string& motion, std::uint64_t seed,
                             const std::string& scene = "room") {
  SimulatorOptions simulation;
  simulation.scene = scene;
  simulation.motion = motion;
  simulation.seed = seed;
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = 10.0;
  Simulator simulator(simulation);
  Tracker tracker(simulator.camera(), TrackerOptions());
  SimulatedRun run;
  const Eigen::Isometry3d T_start_world =
      simulator.truthAt(Simulator::kFirstStampS).T_world_camera.inverse();
  while (const auto image = simulator.next()) {
    const auto frame = tracker.track(image->image, image->stamp_s);
    ++run.frames;
    run.truth.push_back({image->stamp_s, T_start_world * image->truth.T_world_camera});
    if (frame->state != TrackingState::kTracking) {
      if (run.first_untracked < 0) run.first_untracked = image->index;
      continue;
    }
    run.tracked.push_back({image->stamp_s, frame->camera.poseWorldCamera()});
    run.covariances.emplace_back(frame->camera_covariance.topLeftCorner<6, 6>());
  }
  return run;
}

/// Normalised squared errors of the poses in the map's unit, from 1 s after the start on (before,
/// the start pose, which is the world's origin by definition, rules them).
std::vector<double> poseNees(const SimulatedRun& run, double scale) {
  std::vector<double> nees;
  for (std::size_t i = 0; i < run.tracked.size(); ++i) {
    const double stamp_s = run.tracked[i].stamp_s;
    if (stamp_s < Simulator::kFirstStampS + 1.0) continue;
    const auto truth = std::find_if(run.truth.begin(), run.truth.end(),
                                    [&](const StampedPose& p) { return p.stamp_s == stamp_s; });
    Eigen::Isometry3d T_world_camera = truth->T_world_camera;
    T_world_camera.translation() /= scale;
    const auto value = normalisedErrorSquared(
        poseError(run.tracked[i].T_world_camera, T_world_camera), run.covariances[i]);
    if (value) nees.push_back(*value);
  }
  std::sort(nees.begin(), nees.end());
  return nees;
}

/// Scenes that go from near to very far, in which the first images are most easily misread.
TEST(SimulatedDepths, OfAllKindsAreReadRightlyFromTheFirstImages) {
  for (const auto& [scene, motion] :
       {std::make_pair("corridor", "slow"), std::make_pair("office", "forward")}) {
    const SimulatedRun run = trackSimulation(motion, 11, scene);
    EXPECT_EQ(static_cast<int>(run.tracked.size()), run.frames) << scene;
    const auto pairs = pairPoses(run.tracked, run.truth);
    const auto alignment = align(pairs, AlignmentKind::kSimilarity);
    ASSERT_TRUE(alignment) << scene;
    const double error = absoluteTrajectoryError(pairs, *alignment);
    const double path = measureExcursion(run.truth).path_length;
    EXPECT_LT(error, 0.01 * path) << scene;
    std::printf("%s, %s: error %.2f %% of the path\n", scene, motion, 100.0 * error / path);
  }
}

class SimulatedSequences : public testing::TestWithParam<std::tuple<const char*, int>> {};

TEST_P(SimulatedSequences, AreTrackedToTheEndWithinOnePercentOfThePath) {
  const auto [motion, seed] = GetParam();
  const SimulatedRun run = trackSimulation(motion, static_cast<std::uint64_t>(seed));
  EXPECT_EQ(static_cast<int>(run.tracked.size()), run.frames)
      << "first frame without a pose: " << run.first_untracked;

  const auto pairs = pairPoses(run.tracked, run.truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  ASSERT_TRUE(alignment);
  const double error = absoluteTrajectoryError(pairs, *alignment);
  const double path = measureExcursion(run.truth).path_length;
  EXPECT_LT(error, 0.01 * path);

  const auto nees = poseNees(run, alignment->scale);
  ASSERT_EQ(nees.size(),
            static_cast<std::size_t>(std::count_if(
                run.tracked.begin(), run.tracked.end(),
                [](const StampedPose& p) { return p.stamp_s >= Simulator::kFirstStampS + 1.0; })))
      << "every covariance is positive definite";
  double mean = 0.0;
  for (double value : nees) mean += value / static_cast<double>(nees.size());
  std::printf(
      "room %s seed %d: %zu of %d frames tracked, error %.2f mm = %.3f %% of %.2f m; pose NEES "
      "(6 degrees) mean %.1f median %.1f, %.0f %% within 95 %% bounds\n",
      motion, seed, run.tracked.size(), run.frames, 1e3 * error, 100.0 * error / path, path, mean,
      nees[nees.size() / 2], 100.0 * shareWithin(nees, chiSquareMeanBounds(6, 1)));
}

INSTANTIATE_TEST_SUITE_P(Room, SimulatedSequences,
                         testing::Combine(testing::Values("slow", "jerky"), testing::Values(1, 2)));

}  // namespace
}  // namespace active_matching_slam
