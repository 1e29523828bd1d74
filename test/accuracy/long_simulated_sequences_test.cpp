// The default configuration in a simulated room, against exact truth: accuracy of the poses as they
// were given out at the time, over every frame, and how honest their covariance is.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <tuple>

#include "accuracy/long_runs.h"
#include "accuracy/simulated_run.h"
#include "active_matching_slam/evaluation/consistency.h"

namespace active_matching_slam {
namespace {

using test::SimulatedRun;

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
  return test::trackSimulation(&simulator, simulator.camera().calibration(), TrackerOptions());
}

/// Normalised squared errors of the poses from 1 s after the start on (before, the start pose,
/// which is the world's origin by definition, rules them).
std::vector<double> poseNees(const SimulatedRun& run) {
  const std::vector<double> all = frameErrors(run.records, run.truth).pose_nees;
  std::vector<double> nees;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (run.records[i].pose.stamp_s >= Simulator::kFirstStampS + 1.0) nees.push_back(all[i]);
  return nees;
}

/// Scenes that go from near to very far, in which the first images are most easily misread.
class LongSimulatedDepths : public test::LongRuns {};

TEST_F(LongSimulatedDepths, OfAllKindsAreReadRightlyFromTheFirstImages) {
  for (const auto& [scene, motion] :
       {std::make_pair("corridor", "slow"), std::make_pair("office", "forward")}) {
    const SimulatedRun run = trackSimulation(motion, 11, scene);
    const RunSummary summary = summarise(run.records, run.truth);
    EXPECT_EQ(summary.frames_tracked, summary.frames) << scene;
    ASSERT_TRUE(summary.ate_sim3_m) << scene;
    const double error = *summary.ate_sim3_m;
    const double path = measureExcursion(run.truth.trajectory).path_length;
    EXPECT_LT(error, 0.01 * path) << scene;
    std::printf("%s, %s: error %.2f %% of the path\n", scene, motion, 100.0 * error / path);
  }
}

class LongSimulatedSequences : public test::LongRuns,
                               public testing::WithParamInterface<std::tuple<const char*, int>> {};

TEST_P(LongSimulatedSequences, AreTrackedToTheEndWithinOnePercentOfThePath) {
  const auto [motion, seed] = GetParam();
  const SimulatedRun run = trackSimulation(motion, static_cast<std::uint64_t>(seed));
  const RunSummary summary = summarise(run.records, run.truth);
  EXPECT_EQ(summary.frames_tracked, summary.frames);
  ASSERT_TRUE(summary.ate_sim3_m);
  const double error = *summary.ate_sim3_m;
  const double path = measureExcursion(run.truth.trajectory).path_length;
  EXPECT_LT(error, 0.01 * path);

  auto nees = poseNees(run);
  ASSERT_FALSE(nees.empty());
  double mean = 0.0;
  for (double value : nees) {
    ASSERT_TRUE(std::isfinite(value)) << "every covariance is positive definite";
    mean += value / static_cast<double>(nees.size());
  }
  std::sort(nees.begin(), nees.end());
  EXPECT_LT(mean, chiSquareMeanBounds(6, 1).upper) << "the covariance promises too much";
  std::printf(
      "room %s seed %d: %d of %d frames tracked, error %.2f mm = %.3f %% of %.2f m; pose NEES "
      "(6 degrees) mean %.1f median %.1f, %.0f %% within 95 %% bounds\n",
      motion, seed, summary.frames_tracked, summary.frames, 1e3 * error, 100.0 * error / path, path,
      mean, nees[nees.size() / 2], 100.0 * fractionWithin(nees, chiSquareMeanBounds(6, 1)));
}

INSTANTIATE_TEST_SUITE_P(Room, LongSimulatedSequences,
                         testing::Combine(testing::Values("slow", "jerky"), testing::Values(1, 2)));

}  // namespace
}  // namespace active_matching_slam
