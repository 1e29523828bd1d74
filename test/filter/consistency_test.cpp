#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <numeric>

#include "filter/monte_carlo.h"

namespace active_matching_slam {
namespace {

// AMS_MONTE_CARLO_SECONDS: length of a run; the runs are 30 in any case.
double secondsOfARun() {
  const char* text = std::getenv("AMS_MONTE_CARLO_SECONDS");
  return text != nullptr ? std::atof(text) : 10.0;
}

constexpr int kRuns = 30;

SimulationOptions baseOptions() {
  SimulationOptions options;
  options.filter = exampleOptions();
  options.filter.sigma_acceleration_mps2 = 6.0;
  options.filter.sigma_angular_acceleration_rps2 = 10.0;
  options.seconds = secondsOfARun();
  // The simulated camera is exactly as calibrated: doubt of that would be no match of its errors.
  options.filter.initial_sigma_readout_s = options.filter.initial_sigma_focal = 0.0;
  options.filter.initial_sigma_radial = options.filter.initial_sigma_centre = 0.0;
  return options;
}

SimulationOptions modelOptions() {
  SimulationOptions options = baseOptions();
  options.motion = SimulatedMotion::kRandomAcceleration;
  options.filter.sigma_acceleration_mps2 = 2.0;
  options.filter.sigma_angular_acceleration_rps2 = 3.0;
  return options;
}

MonteCarloResult run(const SimulationOptions& options) {
  const MonteCarloResult result = runMonteCarlo(options, kRuns);
  std::cout << "NEES " << result.mean_nees << " (6), within bounds " << result.frames_within
            << ", above " << result.frames_above << ", NIS " << result.mean_nis << " (1), position "
            << 1e3 * result.rms_position_m << " mm, rotation " << 1e3 * result.rms_rotation_rad
            << " mrad\n";
  EXPECT_EQ(result.unhealthy, 0);
  return result;
}

TEST(Consistency, PoseErrorsMatchTheirCovarianceForASlowCamera) {
  SimulationOptions options = baseOptions();
  options.speed = 0.5;
  EXPECT_GE(run(options).frames_within, 0.9);
}

TEST(Consistency, PoseErrorsMatchTheirCovarianceForAJerkyCamera) {
  SimulationOptions options = baseOptions();
  options.speed = 2.0;
  EXPECT_GE(run(options).frames_within, 0.9);
}

TEST(Consistency, PoseErrorsMatchTheirCovarianceForTheMotionOfTheModel) {
  EXPECT_GE(run(modelOptions()).frames_within, 0.9);
}

TEST(Consistency, PoseErrorsMatchTheirCovarianceForSharpMeasurements) {
  SimulationOptions options = baseOptions();
  options.sigma_px = 0.3;
  EXPECT_GE(run(options).frames_within, 0.9);
}

TEST(Consistency, PoseErrorsMatchTheirCovarianceWhereLandmarksHaveProcessNoise) {
  SimulationOptions options = baseOptions();
  options.sigma_px = 0.3;
  options.landmark_noise_px = 1.0;
  options.filter.landmark_noise_px = 1.0;
  const MonteCarloResult modelled = run(options);
  EXPECT_GE(modelled.frames_within, 0.9);
  options.filter.landmark_noise_px = 0.0;
  const MonteCarloResult ignored = run(options);
  EXPECT_GT(ignored.frames_above, 0.5);
  EXPECT_LT(modelled.rms_position_m, ignored.rms_position_m);
}

TEST(Consistency, AtALowFrameRateTheFilterIsNotOverconfident) {
  SimulationOptions options = baseOptions();
  options.rate_hz = 7.5;
  const MonteCarloResult result = run(options);
  EXPECT_LE(result.frames_above, 0.1);
  EXPECT_GE(result.frames_within, 0.75);
}

TEST(Consistency, AtALowFrameRateRepeatedLinearisationIsMoreAccurate) {
  SimulationOptions repeated = baseOptions();
  repeated.rate_hz = 7.5;
  SimulationOptions once = repeated;
  once.filter.update_iterations = 1;
  EXPECT_LT(run(repeated).rms_position_m, 0.95 * run(once).rms_position_m);
}

/// The error of a start lasts to the run's end: its NEES is one draw, of which many are needed.
constexpr int kFreeRuns = 100;

/// With free scale a run is judged in its own unit: truth is scaled by the factor that fits the
/// whole track best.
struct FreeRun {
  double scale = 0.0, rms_m = 0.0, path_m = 0.0;
  std::vector<double> nees;
};

FreeRun runFree(const SimulationOptions& options, unsigned seed) {
  Simulation simulation(options, seed);
  const int frames = static_cast<int>(options.seconds * options.rate_hz);
  std::vector<CameraState> truth, estimate;
  std::vector<Eigen::Matrix<double, 6, 6>> covariance;
  double cross = 0.0, square = 0.0;
  FreeRun result;
  for (int frame = 0; frame < frames; ++frame) {
    simulation.step();
    truth.push_back(simulation.truth());
    estimate.push_back(simulation.filter().camera());
    covariance.emplace_back(simulation.filter().cameraCovariance().topLeftCorner<6, 6>());
    cross += truth.back().position_world.dot(estimate.back().position_world);
    square += estimate.back().position_world.squaredNorm();
    if (frame > 0)
      result.path_m += (truth[frame].position_world - truth[frame - 1].position_world).norm();
  }
  result.scale = cross / square;
  for (int frame = 0; frame < frames; ++frame) {
    Eigen::Matrix<double, 6, 1> error;
    error << truth[frame].position_world / result.scale - estimate[frame].position_world,
        vectorFromRotation(truth[frame].q_world_camera *
                           estimate[frame].q_world_camera.conjugate());
    result.nees.push_back(error.dot(covariance[frame].ldlt().solve(error)));
    result.rms_m += error.head<3>().squaredNorm() / frames;
  }
  result.rms_m = result.scale * std::sqrt(result.rms_m);
  return result;
}

class FreeScale : public testing::TestWithParam<double> {};

TEST_P(FreeScale, TrackAndCovarianceHoldFromTheFirstImageOn) {
  // Nothing tells of scale but the depths expected of new features. What was taken for the unit at
  // the start must hold to the end: the track is the true one but for one factor near one.
  SimulationOptions options = baseOptions();
  options.metric = false;
  options.speed = GetParam();
  options.sigma_px = 0.3;
  options.filter.initial_inverse_depth = 1.0;
  options.filter.initial_sigma_inverse_depth = 0.5;
  options.filter.linearity_threshold = FilterOptions().linearity_threshold;
  const int frames = static_cast<int>(options.seconds * options.rate_hz);
  std::vector<double> nees(frames, 0.0);
  double worst = 0.0;
  std::vector<double> scales;
  for (int run = 0; run < kFreeRuns; ++run) {
    const FreeRun result = runFree(options, 1000 + run);
    for (int frame = 0; frame < frames; ++frame) nees[frame] += result.nees[frame] / kFreeRuns;
    worst = std::max(worst, result.rms_m / result.path_m);
    scales.push_back(result.scale);
    EXPECT_LT(result.rms_m, 0.01 * result.path_m) << run;
  }
  const auto [low, high] = meanChiSquareBounds(kFreeRuns, 6);
  const auto within = std::count_if(nees.begin(), nees.end(), [low = low, high = high](double v) {
    return v >= low && v <= high;
  });
  std::cout << "speed " << GetParam() << ": NEES within bounds "
            << static_cast<double>(within) / frames << " (" << low << " to " << high << "), mean "
            << std::accumulate(nees.begin(), nees.end(), 0.0) / frames << ", worst error "
            << 100.0 * worst << " % of the path\n";
  EXPECT_GE(static_cast<double>(within), 0.9 * frames);
  // Each run's scale is a draw of how far its points are from what was expected of them.
  const auto near_one = std::count_if(scales.begin(), scales.end(),
                                      [](double scale) { return scale > 0.65 && scale < 1.4; });
  EXPECT_GE(static_cast<double>(near_one), 0.95 * kFreeRuns);
}

INSTANTIATE_TEST_SUITE_P(SlowAndJerky, FreeScale, testing::Values(0.5, 2.0));

}  // namespace
}  // namespace active_matching_slam
