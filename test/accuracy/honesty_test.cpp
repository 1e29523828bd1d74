// Whether the covariance of the pose says how large its error is: on films, of which the exact
// truth is known, by the normalised estimation error squared (NEES); on recordings by the error of
// the position over its standard deviation.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "accuracy/long_runs.h"
#include "accuracy/recorded_run.h"
#include "accuracy/simulated_run.h"
#include "active_matching_slam/evaluation/consistency.h"

namespace active_matching_slam {
namespace {

constexpr int kPoseDegrees = 6;
/// By so much an honest variance may be off, since errors of matches are neither Gaussian nor
/// independent from image to image.
constexpr double kModellingFactor = 1.5;

const std::vector<std::pair<int, int>> kSizes_px = {{320, 240}, {640, 480}, {1024, 768}};

/// Mean over the time of a film of the room, whose unit of length is the likeliest.
double meanNees(std::pair<int, int> size_px, const std::string& motion, std::uint64_t seed,
                double duration_s) {
  SimulatorOptions simulation;
  simulation.motion = motion;
  simulation.seed = seed;
  std::tie(simulation.width, simulation.height) = size_px;
  simulation.duration_s = duration_s;
  const test::SimulatedRun run = test::trackWithDrawnCalibration(simulation);
  const RunSummary summary = summarise(run.records, run.truth);
  std::printf("%dx%d %s seed %d: %d of %d frames tracked, NEES %.2f\n", size_px.first,
              size_px.second, motion.c_str(), static_cast<int>(seed), summary.frames_tracked,
              summary.frames, summary.nees_mean.value_or(std::nan("")));
  std::fflush(stdout);
  EXPECT_EQ(summary.frames_tracked, summary.frames);
  EXPECT_TRUE(summary.nees_mean) << "no covariance is positive definite";
  return summary.nees_mean.value_or(std::nan(""));
}

double meanOf(const std::vector<double>& values) {
  double sum = 0.0;
  for (double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// The bound is that of independent values, one a film: its frames err alike. In so short films most
// of the covariance is that of the initialisation: the lower bound is for the long ones.
TEST(Honesty, OfThePoseOnShortFilms) {
  std::vector<double> nees;
  for (const auto& size_px : kSizes_px) {
    const bool is_large = size_px.first > 640;  // takes ten times as long to render as the small
    nees.push_back(meanNees(size_px, "slow", 1, is_large ? 2.0 : 4.0));
    if (!is_large) nees.push_back(meanNees(size_px, "jerky", 2, 4.0));
  }
  const ChiSquareBounds bounds = chiSquareMeanBounds(kPoseDegrees, static_cast<int>(nees.size()));
  EXPECT_LT(meanOf(nees), bounds.upper * kModellingFactor) << "the covariance is too small";
}

class LongHonesty : public test::LongRuns {};

TEST_F(LongHonesty, OfThePoseOnFilmsOfThreeSizes) {
  for (const auto& size_px : kSizes_px) {
    SCOPED_TRACE(testing::Message() << size_px.first << "x" << size_px.second);
    for (const char* motion : {"slow", "jerky"}) {
      SCOPED_TRACE(motion);
      std::vector<double> nees;
      for (std::uint64_t seed = 1; seed <= 5; ++seed)
        nees.push_back(meanNees(size_px, motion, seed, 10.0));
      EXPECT_GT(meanOf(nees), kPoseDegrees / kModellingFactor) << "the covariance is too large";
      EXPECT_LT(meanOf(nees), kPoseDegrees * kModellingFactor) << "the covariance is too small";
    }
  }
}

/// Of `frames` images at most, 0: all.
void expectHonestPosition(const std::string& name, int frames) {
  test::RecordedRunOptions options;
  options.maximum_frames = frames;
  const double median = test::medianErrorOverSigma(test::trackRecording(name, options));
  std::printf("%s: error over sigma, median %.2f\n", name.c_str(), median);
  EXPECT_GT(median, 0.5) << name << ": the covariance is too large";
  EXPECT_LT(median, 2.0) << name << ": the covariance is too small";
}

class RecordedHonesty : public test::RecordedRuns {};

// Later a hand moves the board, which the truth is relative to.
TEST_F(RecordedHonesty, OfThePositionBeforeACheckerboardAtRest) {
  expectHonestPosition("uzh_vamr_checkerboard", 366);
}

class LongRecordedHonesty : public test::LongRecordedRuns {};

TEST_F(LongRecordedHonesty, OfThePositionByHand) { expectHonestPosition("tum_fr1_xyz", 0); }

TEST_F(LongRecordedHonesty, OfThePositionOfADrone) { expectHonestPosition("euroc_mh05_part", 0); }

}  // namespace
}  // namespace active_matching_slam
