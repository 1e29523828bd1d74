#include "active_matching_slam/evaluation/run_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "active_matching_slam/evaluation/consistency.h"

namespace active_matching_slam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool isMetric(const std::vector<FrameRecord>& records) {
  return !records.empty() && records.back().scale_source != ScaleSource::kFree;
}

/// The map in which most frames were tracked.
int mainMap(const std::vector<FrameRecord>& records) {
  std::map<int, int> frames_in;
  for (const FrameRecord& record : records)
    if (record.isTracked()) ++frames_in[record.map];
  const auto most = std::max_element(frames_in.begin(), frames_in.end(),
                                     [](auto a, auto b) { return a.second < b.second; });
  return most == frames_in.end() ? 0 : most->first;
}

/// Pairs of (record, true pose in truth.trajectory) of the tracked frames, by ascending stamp.
std::vector<std::pair<int, int>> associateTracked(const std::vector<FrameRecord>& records,
                                                  const RunTruth& truth) {
  std::vector<int> record_of_pose;
  Trajectory tracked;
  const int main_map = mainMap(records);
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!records[i].isTracked() || records[i].map != main_map) continue;
    record_of_pose.push_back(static_cast<int>(i));
    tracked.push_back(records[i].pose);
  }
  std::vector<std::pair<int, int>> pairs =
      associateByStamp(tracked, truth.trajectory, truth.association_s);
  for (auto& pair : pairs) pair.first = record_of_pose[pair.first];
  return pairs;
}

std::vector<PosePair> posesOf(const std::vector<std::pair<int, int>>& indices,
                              const std::vector<FrameRecord>& records, const RunTruth& truth) {
  std::vector<PosePair> pairs;
  for (const auto& [r, t] : indices)
    pairs.push_back({records[r].pose.stamp_s, records[r].pose.T_world_camera,
                     truth.trajectory[t].T_world_camera});
  return pairs;
}

/// `pairs` in the world of the map, in which the filter's covariance is stated. A map that was
/// begun metric has the truth's world; one that became so on the way has that of the first camera.
/// One of free scale has its gauge fixed at the first camera, known without error, and the
/// likeliest scale.
std::vector<PosePair> inMapWorld(std::vector<PosePair> pairs, ScaleSource source,
                                 const std::vector<Eigen::Matrix<double, 6, 6>>& covariances) {
  const bool became_metric =
      source == ScaleSource::kOdometry || source == ScaleSource::kCameraHeight;
  const bool has_own_world = source == ScaleSource::kFree || became_metric;
  if (!has_own_world || pairs.empty()) return pairs;
  const Eigen::Isometry3d T_map_truth =
      pairs.front().T_world_camera_estimate * pairs.front().T_world_camera_truth.inverse();
  const Eigen::Vector3d begin = pairs.front().T_world_camera_estimate.translation();
  std::vector<Eigen::Isometry3d> estimates, truth;
  for (PosePair& pair : pairs) {
    pair.T_world_camera_truth = T_map_truth * pair.T_world_camera_truth;
    pair.T_world_camera_truth.pretranslate(-begin);
    pair.T_world_camera_estimate.pretranslate(-begin);
    estimates.push_back(pair.T_world_camera_estimate);
    truth.push_back(pair.T_world_camera_truth);
  }
  const double scale =
      became_metric ? 1.0 : likeliestScale(estimates, truth, covariances).value_or(1.0);
  for (PosePair& pair : pairs) pair.T_world_camera_truth.translation() *= scale;
  return pairs;
}

void summariseErrors(const std::vector<FrameRecord>& records, const RunTruth& truth,
                     RunSummary* summary) {
  const std::vector<PosePair> pairs = posesOf(associateTracked(records, truth), records, truth);
  summary->truth_pairs = static_cast<int>(pairs.size());
  if (const auto rigid = align(pairs, AlignmentKind::kRigid))
    summary->ate_se3_m = absoluteTrajectoryError(pairs, *rigid);
  if (const auto similarity = align(pairs, AlignmentKind::kSimilarity)) {
    summary->ate_sim3_m = absoluteTrajectoryError(pairs, *similarity);
    summary->sim3_scale = similarity->scale;
  }
  if (isMetric(records) || summary->sim3_scale)
    summary->rpe = relativePoseError(pairs, 1.0, isMetric(records) ? 1.0 : *summary->sim3_scale);
  if (!truth.simulated) return;
  std::vector<double> nees;
  for (double value : frameErrors(records, truth).pose_nees)
    if (std::isfinite(value)) nees.push_back(value);
  if (nees.empty()) return;
  double sum = 0.0;
  for (double value : nees) sum += value;
  summary->nees_mean = sum / static_cast<double>(nees.size());
  summary->nees_fraction_within = fractionWithin(nees, chiSquareMeanBounds(6, 1));
}

/// The text that occurs most often; of as frequent ones the first by the alphabet.
std::string mostFrequent(const std::map<std::string, int>& texts) {
  int most = 0;
  std::string found;
  for (const auto& [text, times] : texts) {
    if (times <= most) continue;
    most = times;
    found = text;
  }
  return found;
}

void summariseMotion(const std::vector<FrameRecord>& records, RunSummary* summary) {
  std::map<std::string, int> faults;
  for (const FrameRecord& record : records) {
    const bool is_told = !record.motion_source.empty(), is_faulty = !record.motion_fault.empty();
    if (is_told) ++summary->frames_with_motion;
    if (is_told && is_faulty) ++summary->frames_slipped;
    if (!is_told && is_faulty) ++summary->frames_without_motion;
    if (!is_told && is_faulty) ++faults[record.motion_fault];
  }
  summary->motion_fault = mostFrequent(faults);
}

void summariseMatching(const std::vector<FrameRecord>& records, RunSummary* summary) {
  double matched = 0.0, candidates = 0.0;
  std::map<std::string, int> untracked;
  for (const FrameRecord& record : records) {
    const MatchStatistics& matching = record.matching;
    if (record.isTracked()) {
      ++summary->frames_tracked;
      matched += matching.matched;
      candidates += matching.candidates;
    } else if (!record.reason.empty()) {
      ++untracked[record.reason];
    }
    if (!matching.matcher.empty()) summary->matcher = matching.matcher;
    summary->pixels_searched += matching.pixels_searched;
    summary->pixels_full_gates += matching.pixels_full_gates;
    summary->max_gaussians = std::max(summary->max_gaussians, matching.max_gaussians);
    if (matching.cut_short) ++summary->cut_short_frames;
    if (matching.ambiguous) ++summary->ambiguous_frames;
    summary->map_features_most = std::max(summary->map_features_most, record.map_features);
    summary->started += record.features_started;
    summary->retired += record.features_retired;
    summary->converted += record.features_converted;
    summary->submaps_end = record.submaps;
    summary->frozen_features_end = record.frozen_features;
    summary->lost_bits_end = record.lost_bits;
    summary->trunk_features_most = std::max(summary->trunk_features_most, record.trunk_features);
    summary->submaps_frozen = std::max(summary->submaps_frozen, record.submaps_frozen);
    summary->submaps_found = std::max(summary->submaps_found, record.submaps_found);
    summary->loops = std::max(summary->loops, record.loops);
    summary->times_lost = std::max(summary->times_lost, record.times_lost);
    summary->resets = std::max(summary->resets, record.resets);
    summary->late_images = std::max(summary->late_images, record.late_images);
    if (!record.reason.empty()) summary->last_reason = record.reason;
  }
  summary->untracked_reason = mostFrequent(untracked);
  std::set<int> maps;
  std::vector<double> qualities, fixed;
  std::map<std::string, int> causes;
  summary->main_map = mainMap(records);
  for (const FrameRecord& record : records) {
    if (!record.isTracked()) continue;
    maps.insert(record.map);
    if (record.map == summary->main_map) ++summary->frames_in_main_map;
    qualities.push_back(record.quality);
    fixed.push_back(record.image_fixed);
    if (!record.quality_reason.empty()) ++causes[record.quality_reason];
  }
  summary->maps = static_cast<int>(maps.size());
  if (!qualities.empty()) summary->quality = percentile(std::move(qualities), 0.5);
  if (!fixed.empty()) summary->image_fixed = percentile(std::move(fixed), 0.5);
  summary->quality_reason = mostFrequent(causes);
  if (summary->frames_tracked > 0) {
    summary->matched_mean = matched / summary->frames_tracked;
    summary->candidates_mean = candidates / summary->frames_tracked;
  }
}

}  // namespace

Trajectory trackedTrajectory(const std::vector<FrameRecord>& records) {
  Trajectory trajectory;
  for (const FrameRecord& record : records)
    if (record.isTracked()) trajectory.push_back(record.pose);
  return trajectory;
}

double percentile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0.0;
  const double rank = std::ceil(fraction * static_cast<double>(values.size()));
  const std::size_t index =
      std::min(values.size() - 1, static_cast<std::size_t>(std::max(0.0, rank - 1.0)));
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[index];
}

std::vector<std::pair<std::string, double>> namedDurations(const FrameRecord& record) {
  const FrameTimings& t = record.timings_ms;
  const MatchStatistics& m = record.matching;
  return {{"predict", t.predict},
          {"measure", t.measure},
          {"match", t.match},
          {"update", t.update},
          {"map", t.map},
          {"structure", t.structure},
          {"match_information", m.information_ms},
          {"match_correlation", m.correlation_ms},
          {"match_mixture", m.mixture_ms},
          {"match_tree", m.tree_ms},
          {"total", t.total}};
}

FrameErrors frameErrors(const std::vector<FrameRecord>& records, const RunTruth& truth) {
  FrameErrors errors;
  errors.position_m.assign(records.size(), kNaN);
  errors.pose_nees.assign(records.size(), kNaN);
  const std::vector<std::pair<int, int>> indices = associateTracked(records, truth);
  const std::vector<PosePair> pairs = posesOf(indices, records, truth);
  const bool metric = isMetric(records);
  const auto alignment = align(pairs, metric ? AlignmentKind::kRigid : AlignmentKind::kSimilarity);
  if (alignment) {
    for (std::size_t i = 0; i < pairs.size(); ++i)
      errors.position_m[indices[i].first] = absoluteTrajectoryError({pairs[i]}, *alignment);
  }
  if (!truth.simulated) return errors;
  std::vector<Eigen::Matrix<double, 6, 6>> covariances;
  for (const auto& [r, t] : indices) covariances.push_back(records[r].pose_covariance);
  const std::vector<PosePair> in_map = inMapWorld(pairs, records.back().scale_source, covariances);
  for (std::size_t i = 0; i < in_map.size(); ++i) {
    const auto nees = normalisedErrorSquared(
        poseError(in_map[i].T_world_camera_estimate, in_map[i].T_world_camera_truth),
        covariances[i]);
    if (nees) errors.pose_nees[indices[i].first] = *nees;
  }
  return errors;
}

RunSummary summarise(const std::vector<FrameRecord>& records, const RunTruth& truth) {
  RunSummary summary;
  summary.frames = static_cast<int>(records.size());
  if (records.empty()) return summary;
  summary.scale_source = records.back().scale_source;
  summary.scale_sigma = records.back().scale_sigma;
  summariseMotion(records, &summary);
  summary.duration_s = records.back().pose.stamp_s - records.front().pose.stamp_s;
  summary.map_features_end = records.back().map_features;
  summariseMatching(records, &summary);
  summariseErrors(records, truth, &summary);
  summary.excursion = measureExcursion(trackedTrajectory(records));

  const std::size_t stages = namedDurations(records.front()).size();
  std::vector<std::vector<double>> values(stages);
  for (const FrameRecord& record : records) {
    if (record.ignored_image) continue;
    const auto durations = namedDurations(record);
    for (std::size_t stage = 0; stage < stages; ++stage)
      values[stage].push_back(durations[stage].second);
  }
  for (std::size_t stage = 0; stage < stages; ++stage)
    summary.durations.push_back({namedDurations(records.front())[stage].first,
                                 percentile(values[stage], 0.5), percentile(values[stage], 0.99)});
  return summary;
}

}  // namespace active_matching_slam
