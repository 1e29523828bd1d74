#pragma once

#include <optional>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/frame_record.h"
#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/evaluation/trajectory_error.h"

namespace active_matching_slam {

/// The true trajectory of a run.
struct RunTruth {
  Trajectory trajectory;  ///< empty: unknown
  /// Exact (from a simulation), so that errors may be held against the filter's covariance. When
  /// the run's scale is metric its world must be the truth's world; when free, the first camera is.
  bool simulated = false;
  double association_s = 0.02;  ///< largest difference of stamps that count as the same moment
};

/// Errors of the tracked frames against the truth, one entry a frame; NaN where there is none.
struct FrameErrors {
  std::vector<double> position_m;  ///< after Sim(3) alignment, SE(3) when the scale is metric
  std::vector<double> pose_nees;   ///< 6 degrees of freedom; simulated truth only
};

struct DurationSummary {
  std::string stage;
  double median_ms = 0.0;
  double p99_ms = 0.0;
};

/// The result of a run in numbers. Lengths are in metres where the scale is metric or after Sim(3)
/// alignment to a metric truth; excursion and displacement are in map units otherwise.
struct RunSummary {
  int frames = 0;
  int frames_tracked = 0;
  int times_lost = 0;
  int resets = 0;
  int late_images = 0;
  std::string last_reason;       ///< of the last frame that has one: why its state is what it is
  std::string untracked_reason;  ///< the most frequent one of frames that were not tracked
  std::string matcher;
  ScaleSource scale_source = ScaleSource::kFree;  ///< at the end
  double scale_sigma = 0.0;  ///< relative, of lengths as a whole at the end; 0: not known
  /// Frames whose motion odometry or gyro told of, and those of these in which it was taken for
  /// slip; frames in which it was missing, or wrong, and what was wrong most often.
  int frames_with_motion = 0, frames_slipped = 0, frames_without_motion = 0;
  std::string motion_fault;
  double duration_s = 0.0;  ///< from first to last stamp

  int maps = 0;      ///< in which the camera was tracked
  int main_map = 0;  ///< that of most tracked frames: errors are of the poses in it
  int frames_in_main_map = 0;
  double quality = 1.0;        ///< median over the tracked frames
  double image_fixed = 0.0;    ///< share of the image that is no scene: the same
  std::string quality_reason;  ///< the most frequent cause of a low one
  int truth_pairs = 0;         ///< tracked frames with a true pose
  std::optional<double> ate_sim3_m, ate_se3_m, sim3_scale;
  std::optional<double> ate_final_sim3_m;  ///< of RunReport::finalTrajectory()
  std::optional<RelativePoseError> rpe;    ///< over 1 s; scaled as Sim(3) where the scale is free
  std::optional<double> nees_mean;         ///< of the 6-D pose over the frames
  std::optional<double> nees_fraction_within;  ///< of frames within their own 95 % bounds
  Excursion excursion;

  double matched_mean = 0.0, candidates_mean = 0.0;  ///< over the tracked frames
  std::int64_t pixels_searched = 0, pixels_full_gates = 0;
  int max_gaussians = 0;
  int cut_short_frames = 0, ambiguous_frames = 0;
  int map_features_end = 0, map_features_most = 0;
  std::int64_t started = 0, retired = 0, converted = 0;
  int submaps_end = 0, frozen_features_end = 0, trunk_features_most = 0;  ///< FrozenMap
  double lost_bits_end = 0.0;
  int submaps_frozen = 0, submaps_found = 0, loops = 0;
  /// Every stage, then "total"; over the frames whose image was not ignored.
  std::vector<DurationSummary> durations;
};

/// Nothing here depends on durations, except `durations`.
RunSummary summarise(const std::vector<FrameRecord>& records, const RunTruth& truth);
FrameErrors frameErrors(const std::vector<FrameRecord>& records, const RunTruth& truth);

Trajectory trackedTrajectory(const std::vector<FrameRecord>& records);

/// Nearest-rank percentile, `fraction` in (0, 1]; 0 without values.
double percentile(std::vector<double> values, double fraction);

/// Durations of a frame by name [ms]: the stages of FrameTimings but its total, then the parts of
/// matching, then "total".
std::vector<std::pair<std::string, double>> namedDurations(const FrameRecord& record);

std::string summaryJson(const RunSummary& summary);

}  // namespace active_matching_slam
