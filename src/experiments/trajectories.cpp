// Figures 7.9 to 7.11: trajectories of AM, CLAM and FAM with 40 and with 100 features, in an office
// and along a walkway.

#include "active_matching_slam/evaluation/trajectory_error.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

/// Lowered "to allow for tracking a hundred features", so that many lie on edges (section 7.5.2).
constexpr double kEdgeQuality = 0.001;

struct TrackedRun {
  int frames = 0, tracked = 0;
  Trajectory trajectory;
  double ate_m = 0.0, ate_percent = 0.0;  ///< after Sim(3) alignment; percent of the path
  double rotation_rmse_deg = 0.0;         ///< of the motion over a second
  double matched = 0.0;
};

TrackedRun runMatcher(const Sequence& sequence, const std::string& matcher, int features,
                      int every) {
  TrackerOptions options = referenceOptions(sequence, features);
  options.matcher = matcher;
  options.matching = matcherVariant(matcher).options;
  // The matcher alone decides, with the same rates for all features (section 7.5.2).
  options.fallback_matchers = false;
  options.learn_rates = false;
  if (sequence.name == "planks") options.image.corner_quality = kEdgeQuality;
  TrackedRun run;
  trackSequence(sequence, options, every, [&](const TrackedFrame& frame, int) {
    ++run.frames;
    if (frame.state != TrackingState::kTracking) return;
    ++run.tracked;
    run.trajectory.push_back({frame.stamp_s, frame.camera.poseWorldCamera()});
    run.matched += frame.matching.statistics.matched;
  });
  run.matched /= std::max(1, run.tracked);
  const auto pairs = pairPoses(run.trajectory, sequence.truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  if (!alignment) {
    run.ate_m = run.ate_percent = run.rotation_rmse_deg = std::nan("");
    return run;
  }
  run.ate_m = absoluteTrajectoryError(pairs, *alignment);
  run.ate_percent = 100.0 * run.ate_m / measureExcursion(sequence.truth).path_length;
  const auto relative = relativePoseError(pairs, 1.0, alignment->scale);
  run.rotation_rmse_deg = relative ? relative->rotation_rmse_rad * 180.0 / M_PI : std::nan("");
  for (StampedPose& pose : run.trajectory) pose.T_world_camera = (*alignment)(pose.T_world_camera);
  return run;
}

/// From above: the simulated worlds have z up.
ChartSeries seenFromAbove(const std::string& name, const Trajectory& trajectory) {
  ChartSeries series{name, {}};
  for (const StampedPose& pose : trajectory)
    series.points.push_back(pose.T_world_camera.translation().head<2>());
  return series;
}

std::string resultText(const TrackedRun& run) {
  return text("%d of %d frames, error %.1f %% of the path", run.tracked, run.frames,
              run.ate_percent);
}

}  // namespace

ExperimentResult runTrajectories(Workbench& bench) {
  const std::vector<std::string> matchers = {"active", "chow_liu", "fast_active"};
  const std::vector<int> counts = bench.quick() ? std::vector<int>{40} : std::vector<int>{40, 100};
  const std::vector<int> everies = bench.quick() ? std::vector<int>{1} : std::vector<int>{1, 4};
  Table table({"sequence", "rate_hz", "matcher", "features", "frames", "tracked", "matched",
               "ate_m", "ate_percent_of_path", "rotation_rmse_deg_per_s"});
  ExperimentResult result;
  std::vector<cv::Mat> pictures;
  std::vector<std::string> names = {"office_slow", "walkway_straight"};
  if (!bench.quick()) names.push_back("planks");
  for (const std::string& name : names)
    for (const int every : everies) {
      const Sequence& sequence = bench.sequence(name);
      LineChart chart{text("%s, %.4g Hz, from above", name.c_str(), 30.0 / every), "x [m]",
                      "y [m]"};
      chart.equal_axes = true;
      chart.markers = false;
      chart.series.push_back(seenFromAbove("truth", sequence.truth));
      std::vector<TrackedRun> with_most;
      for (const int features : counts)
        for (const std::string& matcher : matchers) {
          bench.say(text("trajectory of %s, %s, %d features, %.4g Hz", name.c_str(),
                         matcher.c_str(), features, 30.0 / every));
          const TrackedRun run = runMatcher(sequence, matcher, features, every);
          table.add({name, 30.0 / every, matcher, features, run.frames, run.tracked, run.matched,
                     run.ate_m, run.ate_percent, run.rotation_rmse_deg});
          chart.series.push_back(
              seenFromAbove(matcher + " " + std::to_string(features), run.trajectory));
          if (features == counts.back()) with_most.push_back(run);
        }
      pictures.push_back(drawLineChart(chart, 900, 600));
      // Kept: every frame, and no worse than AM by half.
      const auto isKept = [&](const TrackedRun& run) {
        return run.tracked == run.frames && run.ate_m < 1.5 * with_most[0].ate_m + 0.005;
      };
      const bool is_walkway = name != "office_slow";
      const auto add = [&](std::size_t m, const char* thesis, bool agrees) {
        result.findings.push_back({text("%s, %d features, %s, %.4g Hz", matchers[m].c_str(),
                                        counts.back(), name.c_str(), 30.0 / every),
                                   thesis, resultText(with_most[m]), verdict(agrees)});
      };
      add(0, is_walkway ? "kept, straight" : "the model trajectory",
          with_most[0].tracked == with_most[0].frames && with_most[0].ate_percent < 10.0);
      add(1, is_walkway ? "kept, straight, as AM" : "almost that of AM", isKept(with_most[1]));
      add(2, is_walkway ? "lost: no resemblance to the path" : "similar, jerky at the end",
          isKept(with_most[2]) != is_walkway);
    }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures(pictures, 2));
  return result;
}

}  // namespace active_matching_slam
