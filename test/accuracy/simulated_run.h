#pragma once

#include <string>
#include <vector>

#include "active_matching_slam/evaluation/run_summary.h"
#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace test {

struct SimulatedRun {
  std::vector<FrameRecord> records;
  RunTruth truth;
};

inline SimulatedRun trackSimulation(Simulator* simulator, const CameraCalibration& calibration,
                                    const TrackerOptions& options) {
  Tracker tracker(CameraModel(calibration), options);
  SimulatedRun run;
  run.truth.simulated = true;
  while (const auto image = simulator->next()) {
    run.records.push_back(recordOf(*tracker.track(image->image, image->stamp_s)));
    run.truth.trajectory.push_back({image->stamp_s, image->truth.T_world_camera});
  }
  return run;
}

/// What a good calibration with a printed board is off by; of the focal length the relative error.
constexpr double kSigmaFocal = 1e-3;
constexpr double kSigmaCentre_px = 0.5;  ///< per axis

/// With errors of these standard deviations, drawn anew for each seed.
inline CameraCalibration drawnCalibration(CameraCalibration calibration, std::uint64_t seed) {
  Random random(seed);
  // Twelve even draws add up to a variance of one, and nearly to a Gaussian.
  const auto normal = [&random] {
    double sum = -6.0;
    for (int k = 0; k < 12; ++k) sum += random.uniform();
    return sum;
  };
  const double factor = 1.0 + kSigmaFocal * normal();
  calibration.fx *= factor;
  calibration.fy *= factor;
  calibration.cx += kSigmaCentre_px * normal();
  calibration.cy += kSigmaCentre_px * normal();
  return calibration;
}

/// A rendered film, tracked with a drawn calibration and priors that say how far off it may be.
inline SimulatedRun trackWithDrawnCalibration(const SimulatorOptions& simulation) {
  Simulator simulator(simulation);
  const CameraCalibration& calibration = simulator.camera().calibration();
  TrackerOptions options;
  options.filter.initial_sigma_focal = kSigmaFocal;
  options.filter.initial_sigma_centre = kSigmaCentre_px / calibration.fx;
  return trackSimulation(&simulator, drawnCalibration(calibration, simulation.seed), options);
}

}  // namespace test
}  // namespace active_matching_slam
