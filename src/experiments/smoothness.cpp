// Figure 7.1: how smooth the trajectory is, by the number of features that are measured in a frame.

#include <cmath>

#include "active_matching_slam/evaluation/trajectory_error.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

struct JitterRun {
  int frames = 0, tracked = 0;
  Trajectory trajectory;  ///< as the truth, after Sim(3) alignment
  double step_error_mm = 0.0;
  /// Root mean square second difference of the positions, beyond that of the truth: how far a pose
  /// lies from the middle of its neighbours.
  double jitter_mm = 0.0;
};

double secondDifference(const std::vector<PosePair>& pairs, const Alignment& alignment) {
  double squares = 0.0;
  int count = 0;
  for (std::size_t i = 1; i + 1 < pairs.size(); ++i) {
    const auto error = [&](std::size_t k) -> Eigen::Vector3d {
      return alignment(Eigen::Vector3d(pairs[k].T_world_camera_estimate.translation())) -
             pairs[k].T_world_camera_truth.translation();
    };
    squares += (error(i - 1) - 2.0 * error(i) + error(i + 1)).squaredNorm();
    ++count;
  }
  return std::sqrt(squares / std::max(1, count));
}

JitterRun runWith(const Sequence& sequence, int features) {
  JitterRun run;
  trackSequence(sequence, referenceOptions(sequence, features), 1,
                [&](const TrackedFrame& frame, int) {
                  ++run.frames;
                  if (frame.state != TrackingState::kTracking) return;
                  ++run.tracked;
                  run.trajectory.push_back({frame.stamp_s, frame.camera.poseWorldCamera()});
                });
  const auto pairs = pairPoses(run.trajectory, sequence.truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  run.jitter_mm = run.step_error_mm = std::nan("");
  if (!alignment) return run;
  run.jitter_mm = 1e3 * secondDifference(pairs, *alignment);
  if (const auto step = relativePoseError(pairs, 1.0 / 30.0, alignment->scale))
    run.step_error_mm = 1e3 * step->translation_rmse;
  for (StampedPose& pose : run.trajectory) pose.T_world_camera = (*alignment)(pose.T_world_camera);
  return run;
}

}  // namespace

ExperimentResult runSmoothness(Workbench& bench) {
  const Sequence& sequence = bench.sequence("corridor");
  Table table({"features", "frames", "tracked", "jitter_mm", "step_error_mm"});
  ExperimentResult result;
  LineChart chart{"Along a corridor, from above (7.1)", "x [m]", "y [m]"};
  chart.markers = false;
  const int counts[] = {20, 40, 60};
  std::vector<double> jitter;
  std::string here;
  for (const int features : counts) {
    bench.say(text("trajectory along a corridor with %d features", features));
    const JitterRun run = runWith(sequence, features);
    table.add({features, run.frames, run.tracked, run.jitter_mm, run.step_error_mm});
    ChartSeries series{text("%d features", features), {}};
    for (const StampedPose& pose : run.trajectory)
      series.points.push_back(pose.T_world_camera.translation().head<2>());
    chart.series.push_back(series);
    jitter.push_back(run.jitter_mm);
    here += text("%s%d: %.3f", here.empty() ? "" : "; ", features, run.jitter_mm);
  }
  ChartSeries truth{"truth", {}};
  for (const StampedPose& pose : sequence.truth)
    truth.points.push_back(pose.T_world_camera.translation().head<2>());
  chart.series.push_back(truth);
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", drawLineChart(chart, 960, 480));
  result.findings.push_back(
      {"distance of a pose from the middle of its neighbours, but for the "
       "truth's, by features [mm]",
       "far smoother with 40 than with 20", here, verdict(jitter[1] < jitter[0])});
  result.findings.push_back({"... gained by 20 more, and by 20 more again [mm]",
                             "with 60 a much smaller difference",
                             text("%.3f; %.3f", jitter[0] - jitter[1], jitter[1] - jitter[2]),
                             verdict(jitter[1] - jitter[2] < jitter[0] - jitter[1])});
  return result;
}

}  // namespace active_matching_slam
