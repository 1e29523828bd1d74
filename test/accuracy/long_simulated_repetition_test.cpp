// Repeated structure at a low frame rate, in simulation: the corners of a checkerboard all look
// alike, and the gates hold many of them.

#include <gtest/gtest.h>

#include <cstdio>

#include "accuracy/long_runs.h"
#include "active_matching_slam/evaluation/trajectory_error.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

struct BoardRun {
  int frames = 0, tracked = 0;
  double error_of_path = 0.0;  ///< absolute trajectory error over the length of the path
};

BoardRun trackCheckerboard(const std::string& matcher, double rate_hz, bool fallback_matchers) {
  SimulatorOptions simulation;
  simulation.scene = "checkerboard";
  simulation.width = 320;
  simulation.height = 240;
  simulation.rate_hz = rate_hz;
  simulation.duration_s = 10.0;
  Simulator simulator(simulation);
  TrackerOptions options;
  options.matcher = matcher;
  options.fallback_matchers = fallback_matchers;
  Tracker tracker(simulator.camera(), options);
  Trajectory tracked, truth;
  BoardRun run;
  while (const auto image = simulator.next()) {
    const auto frame = tracker.track(image->image, image->stamp_s);
    ++run.frames;
    truth.push_back({image->stamp_s, image->truth.T_world_camera});
    if (frame->state == TrackingState::kTracking)
      tracked.push_back({image->stamp_s, frame->camera.poseWorldCamera()});
  }
  run.tracked = static_cast<int>(tracked.size());
  const auto pairs = pairPoses(tracked, truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  const double path = measureExcursion(truth).path_length;
  run.error_of_path = alignment ? absoluteTrajectoryError(pairs, *alignment) / path : 1.0;
  std::printf("%s at %g Hz%s: %d of %d frames, error %.2f %% of the path\n", matcher.c_str(),
              rate_hz, fallback_matchers ? ", with fallback matchers" : "", run.tracked, run.frames,
              100.0 * run.error_of_path);
  return run;
}

class LongSimulatedRepetition : public test::LongRuns,
                                public testing::WithParamInterface<double> {};

TEST_P(LongSimulatedRepetition, ActiveMatchingKeepsTheCheckerboardAsWellAsJcbb) {
  const BoardRun active = trackCheckerboard("active", GetParam(), true);
  EXPECT_EQ(active.tracked, active.frames);
  EXPECT_LT(active.error_of_path, 0.003);
  const BoardRun jcbb = trackCheckerboard("jcbb", GetParam(), true);
  EXPECT_GE(active.tracked, jcbb.tracked);
  EXPECT_LT(active.error_of_path, 1.5 * jcbb.error_of_path);
}

TEST_P(LongSimulatedRepetition,
       ActiveSearchAloneLosesItAndRansacAloneIsNoBetterThanActiveMatching) {
  const BoardRun active = trackCheckerboard("active", GetParam(), true);
  const BoardRun search = trackCheckerboard("active_search", GetParam(), false);
  EXPECT_LT(search.tracked, search.frames);
  const BoardRun ransac = trackCheckerboard("one_point_ransac", GetParam(), false);
  EXPECT_TRUE(ransac.tracked < ransac.frames || ransac.error_of_path > 0.9 * active.error_of_path);
}

INSTANTIATE_TEST_SUITE_P(Hertz, LongSimulatedRepetition, testing::Values(10.0, 7.5));

}  // namespace
}  // namespace active_matching_slam
