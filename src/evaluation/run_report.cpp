#include "active_matching_slam/evaluation/run_report.h"

#include <cmath>
#include <functional>
#include <stdexcept>

#include "active_matching_slam/evaluation/structure_report.h"
#include "active_matching_slam/evaluation/text_file.h"
#include "active_matching_slam/evaluation/trajectory_plot.h"

namespace active_matching_slam {
namespace {

struct Column {
  std::string name;
  std::function<std::string(std::size_t row, const FrameRecord&)> text;
};

std::string cell(double value) { return std::isnan(value) ? "" : numberText(value); }
std::string cell(bool value) { return value ? "1" : "0"; }
std::string cell(int value) { return std::to_string(value); }
std::string cell(std::int64_t value) { return std::to_string(value); }
std::string cell(const std::string& value) {
  if (value.find_first_of(",\"\n\r") == std::string::npos) return value;
  std::string quoted = "\"";
  for (char c : value)
    quoted += c == '"' ? "\"\"" : c == '\n' || c == '\r' ? " " : std::string(1, c);
  return quoted + "\"";
}

template <typename F>
Column column(const std::string& name, F value) {
  return {name, [value](std::size_t, const FrameRecord& r) { return cell(value(r)); }};
}

template <typename T>
Column column(const std::string& name, T MatchStatistics::*field) {
  return {name, [field](std::size_t, const FrameRecord& r) { return cell(r.matching.*field); }};
}

template <typename T>
Column column(const std::string& name, T FrameRecord::*field) {
  return {name, [field](std::size_t, const FrameRecord& r) { return cell(r.*field); }};
}

void addStateColumns(const FrameErrors& errors, std::vector<Column>* columns) {
  using R = const FrameRecord&;
  const std::vector<Column> state = {
      column("stamp_s", [](R r) { return r.pose.stamp_s; }),
      column("index", &FrameRecord::index),
      column("state", [](R r) { return trackingStateName(r.state); }),
      column("reason", &FrameRecord::reason),
      column("repeated_image", &FrameRecord::repeated_image),
      column("scale_source", [](R r) { return scaleSourceName(r.scale_source); }),
      column("x_m", [](R r) { return r.pose.T_world_camera.translation().x(); }),
      column("y_m", [](R r) { return r.pose.T_world_camera.translation().y(); }),
      column("z_m", [](R r) { return r.pose.T_world_camera.translation().z(); }),
      column("sigma_position_m",
             [](R r) { return std::sqrt(r.pose_covariance.topLeftCorner<3, 3>().trace()); }),
      column("sigma_rotation_rad",
             [](R r) { return std::sqrt(r.pose_covariance.bottomRightCorner<3, 3>().trace()); }),
      column("speed_mps", &FrameRecord::speed),
      {"position_error_m", [errors](std::size_t row, R) { return cell(errors.position_m[row]); }},
      {"pose_nees", [errors](std::size_t row, R) { return cell(errors.pose_nees[row]); }},
      column("match_sigma_px", &FrameRecord::match_sigma_px),
      column("readout_s", &FrameRecord::readout_s),
      column("lens_focal", [](R r) { return r.lens.focal; }),
      column("lens_radial", [](R r) { return r.lens.radial; }),
      column("lens_centre_x", [](R r) { return r.lens.centre.x(); }),
      column("lens_centre_y", [](R r) { return r.lens.centre.y(); }),
      column("nis", &FrameRecord::nis),
      column("nis_degrees", &FrameRecord::nis_degrees),
      column("resets", &FrameRecord::resets),
      column("times_lost", &FrameRecord::times_lost),
      column("map", &FrameRecord::map),
      column("jumps", &FrameRecord::jumps),
      column("scale_sigma", &FrameRecord::scale_sigma),
      column("motion_source", &FrameRecord::motion_source),
      column("motion_fault", &FrameRecord::motion_fault),
      column("quality", &FrameRecord::quality),
      column("image_fixed", &FrameRecord::image_fixed),
      column("quality_reason", &FrameRecord::quality_reason),
      column("acceleration_mps2", [](R r) { return r.accelerations.linear_mps2; }),
      column("angular_acceleration_rps2", [](R r) { return r.accelerations.angular_rps2; })};
  columns->insert(columns->end(), state.begin(), state.end());
}

void addMatchingColumns(std::vector<Column>* columns) {
  const std::vector<Column> matching = {
      column("matcher", &MatchStatistics::matcher),
      column("candidates", &MatchStatistics::candidates),
      column("matched", &MatchStatistics::matched),
      column("missed", &FrameRecord::missed),
      column("rejected", &FrameRecord::rejected),
      column("searches", &MatchStatistics::searches),
      column("matches_met", &MatchStatistics::matches_met),
      column("pixels_searched", &MatchStatistics::pixels_searched),
      column("pixels_full_gates", &MatchStatistics::pixels_full_gates),
      column("max_gaussians", &MatchStatistics::max_gaussians),
      column("accepted_weight", &MatchStatistics::accepted_weight),
      column("information_start_bits", &MatchStatistics::information_bits_start),
      column("information_end_bits", &MatchStatistics::information_bits_end),
      column("camera_bits", &FrameRecord::camera_bits),
      column("state_bits_left", &FrameRecord::state_bits_left),
      column("camera_bits_per_ms", &FrameRecord::camera_bits_per_ms),
      column("tree_divergence_bits", &FrameRecord::tree_divergence_bits),
      column("ambiguous", &MatchStatistics::ambiguous),
      column("cut_short", &MatchStatistics::cut_short),
      column("degenerate_features", &MatchStatistics::degenerate_features),
      column("nodes", &MatchStatistics::nodes),
      column("map_features", &FrameRecord::map_features),
      column("map_points", &FrameRecord::map_points),
      column("features_started", &FrameRecord::features_started),
      column("features_retired", &FrameRecord::features_retired),
      column("features_converted", &FrameRecord::features_converted),
      column("features_failed", &FrameRecord::features_failed),
      column("submaps", &FrameRecord::submaps),
      column("frozen_features", &FrameRecord::frozen_features),
      column("trunk_features", &FrameRecord::trunk_features),
      column("submap_lost_bits", &FrameRecord::lost_bits),
      column("submaps_frozen", &FrameRecord::submaps_frozen),
      column("submaps_found", &FrameRecord::submaps_found),
      column("loops", &FrameRecord::loops),
      column("map_epoch", &FrameRecord::map_epoch)};
  columns->insert(columns->end(), matching.begin(), matching.end());
}

void addDurationColumns(std::vector<Column>* columns) {
  const auto names = namedDurations(FrameRecord());
  for (std::size_t i = 0; i < names.size(); ++i)
    columns->push_back({names[i].first + "_ms", [i](std::size_t, const FrameRecord& r) {
                          return cell(namedDurations(r)[i].second);
                        }});
}

std::string frozenSubmapsCsv(const FrozenMap& frozen) {
  std::string text = "id,features,separators,lost_bits\n";
  for (const FrozenSubmap& leaf : frozen.leaves)
    text += cell(leaf.id) + "," + cell(leaf.features) + "," + cell(leaf.separators) + "," +
            cell(leaf.lost_bits) + "\n";
  return text;
}

}  // namespace

void RunReport::add(const TrackedFrame& frame) {
  if (frame.rescaled_by != 1.0) {
    rescaleRecords(frame.rescaled_by, frame.scale_sigma, frame.map, &records_);
    for (auto& [id, position] : last_position_of_) position *= frame.rescaled_by;
  }
  records_.push_back(recordOf(frame));
  final_.add(frame);
  frozen_ = frame.frozen;
  if (frame.graph && frame.submaps) {
    graph_ = frame.graph;
    submaps_ = frame.submaps;
  }
  for (const TrackedFeature& feature : frame.features) {
    if (feature.kind == FeatureKind::kInverseDepth &&
        !(feature.sigma_inverse_depth < feature.inverse_depth / 3.0))
      continue;
    if (feature.position_world.allFinite()) last_position_of_[feature.id] = feature.position_world;
  }
}

RunSummary RunReport::summary() const {
  RunSummary summary = summarise(records_, truth_);
  const std::vector<PosePair> pairs =
      pairPoses(finalTrajectory(), truth_.trajectory, truth_.association_s);
  if (const auto similarity = align(pairs, AlignmentKind::kSimilarity))
    summary.ate_final_sim3_m = absoluteTrajectoryError(pairs, *similarity);
  return summary;
}

std::vector<Eigen::Vector3d> RunReport::mapPoints() const {
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, position] : last_position_of_) points.push_back(position);
  return points;
}

std::string RunReport::statisticsCsv() const {
  std::vector<Column> columns;
  addStateColumns(frameErrors(records_, truth_), &columns);
  addMatchingColumns(&columns);
  addDurationColumns(&columns);
  std::string text;
  for (const Column& c : columns) text += (&c == &columns.front() ? "" : ",") + c.name;
  text += "\n";
  for (std::size_t row = 0; row < records_.size(); ++row) {
    for (const Column& c : columns)
      text += (&c == &columns.front() ? "" : ",") + c.text(row, records_[row]);
    text += "\n";
  }
  return text;
}

std::string RunReport::trajectoryText() const {
  std::string text;
  const FrameRecord* before = nullptr;
  for (const FrameRecord& record : records_) {
    if (!record.isTracked()) continue;
    if (before && record.map != before->map) {
      text += "# from here on in map " + std::to_string(record.map) + ", not " +
              std::to_string(before->map) + ": another world and unit of length\n";
    } else if (before && record.jumps != before->jumps) {
      text += "# here the pose jumps: lost before, and found again in the same map\n";
    }
    text += trajectoryTumText({record.pose});
    before = &record;
  }
  return text;
}

void RunReport::write(const std::string& directory) const {
  writeTextFile(directory + "/statistics.csv", statisticsCsv());
  writeTextFile(directory + "/trajectory.txt", trajectoryText());
  writeTextFile(directory + "/trajectory_final.txt", trajectoryTumText(finalTrajectory()));
  writeTextFile(directory + "/summary.json", summaryJson(summary()));
  writeTrajectoryPlot(directory + "/trajectory.png", trajectoryPlotOf(*this));
  if (graph_) writeStructureReport(directory, *graph_, *submaps_);
  if (frozen_ && !frozen_->leaves.empty())
    writeTextFile(directory + "/frozen_submaps.csv", frozenSubmapsCsv(*frozen_));
}

}  // namespace active_matching_slam
