#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/recorded_sequence.h"
#include "active_matching_slam/evaluation/run_summary.h"
#include "active_matching_slam/evaluation/trajectory_error.h"
#include "active_matching_slam/tracker/tracker.h"
#include "support/recorded_data.h"

namespace active_matching_slam {
namespace test {

struct RecordedRunOptions {
  TrackerOptions tracker;
  int every = 1;           ///< of so many images one is tracked
  int maximum_frames = 0;  ///< so many images are tracked at most; 0: all
  bool known_target = false;
  double speed = 1.0;  ///< played at so many times the speed
  std::function<void(CameraCalibration*)> change_calibration;
};

struct RecordedRun {
  std::string name;
  std::vector<FrameRecord> records;  ///< with the stamps of the recording

  int frames() const { return static_cast<int>(records.size()); }
  Trajectory tracked() const { return trackedTrajectory(records); }
  int framesTracked() const { return static_cast<int>(tracked().size()); }
};

inline RecordedRun trackRecording(const std::string& name, RecordedRunOptions options = {}) {
  const std::string folder = recordedDataFolder() + "/" + name;
  if (options.known_target)
    options.tracker.known_points = readKnownPointsYaml(folder + "/known_target.yaml");
  RecordedSequence sequence(folder, options.every);
  CameraCalibration calibration = sequence.camera().calibration();
  if (options.change_calibration) options.change_calibration(&calibration);
  Tracker tracker(CameraModel(calibration), options.tracker);
  RecordedRun run;
  run.name = name;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    run.records.push_back(recordOf(*tracker.track(image, stamp_s / options.speed)));
    run.records.back().pose.stamp_s = stamp_s;
    return run.frames() != options.maximum_frames;
  });
  return run;
}

inline Trajectory truthOf(const std::string& name) {
  const bool is_pseudo = name == "davison_monoslam_desk";
  return readTrajectoryTum(recordedDataFolder() + "/" + name +
                           (is_pseudo ? "/groundtruth_pseudo.txt" : "/groundtruth.txt"));
}

/// Absolute trajectory error.
inline double errorMm(const RecordedRun& run, AlignmentKind kind = AlignmentKind::kSimilarity) {
  const auto pairs = pairPoses(run.tracked(), truthOf(run.name));
  const auto alignment = align(pairs, kind);
  return alignment ? 1e3 * absoluteTrajectoryError(pairs, *alignment) : std::nan("");
}

/// Median over the frames of |e| / sqrt(trace P) of the position, after Sim(3) alignment.
inline double medianErrorOverSigma(const RecordedRun& run) {
  std::vector<const FrameRecord*> tracked;
  for (const FrameRecord& record : run.records)
    if (record.isTracked()) tracked.push_back(&record);
  const Trajectory estimate = run.tracked(), truth = truthOf(run.name);
  const auto alignment = align(pairPoses(estimate, truth), AlignmentKind::kSimilarity);
  if (!alignment) return std::nan("");
  std::vector<double> ratios;
  for (const auto& [e, t] : associateByStamp(estimate, truth)) {
    const Eigen::Vector3d error_m = truth[t].T_world_camera.translation() -
                                    (*alignment)(estimate[e].T_world_camera.translation());
    const double variance = tracked[e]->pose_covariance.topLeftCorner<3, 3>().trace();
    if (variance > 0.0) ratios.push_back(error_m.norm() / (alignment->scale * std::sqrt(variance)));
  }
  return ratios.empty() ? std::nan("") : percentile(ratios, 0.5);
}

}  // namespace test
}  // namespace active_matching_slam
