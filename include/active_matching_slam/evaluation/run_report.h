#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/final_trajectory.h"
#include "active_matching_slam/evaluation/frame_record.h"
#include "active_matching_slam/evaluation/run_summary.h"

namespace active_matching_slam {

/// Collects the frames of a run and writes what came of it. Everything but the durations (columns
/// and keys that end in "_ms", and the key "ms") is the same bit for bit for the same run.
class RunReport {
 public:
  void add(const TrackedFrame& frame);
  void setTruth(RunTruth truth) { truth_ = std::move(truth); }

  const std::vector<FrameRecord>& records() const { return records_; }
  const RunTruth& truth() const { return truth_; }
  Trajectory trajectory() const { return trackedTrajectory(records_); }
  /// In the map as it ends.
  const Trajectory& finalTrajectory() const { return final_.poses(); }
  RunSummary summary() const;

  /// Where the features of the run were last estimated, retired ones included, but those whose
  /// depth was never known to a third [m or map units].
  std::vector<Eigen::Vector3d> mapPoints() const;

  /// One row a frame, comma separated; names and units in the header. Cells without a value are
  /// empty.
  std::string statisticsCsv() const;
  /// TUM text of the tracked poses, with a comment line where another map or a jump begins.
  std::string trajectoryText() const;

  /// Writes statistics.csv, trajectory.txt (TUM, one line for each frame tracked),
  /// trajectory_final.txt (FinalTrajectory), summary.json and trajectory.png into an existing
  /// directory, what writeStructureReport() writes when the tracker kept the structure of the map,
  /// and frozen_submaps.csv when some were laid aside. Throws std::runtime_error naming the file.
  void write(const std::string& directory) const;

 private:
  std::vector<FrameRecord> records_;
  FinalTrajectory final_;
  RunTruth truth_;
  std::map<FeatureId, Eigen::Vector3d> last_position_of_;
  std::shared_ptr<const MutualInformationGraph> graph_;  ///< the last of the run
  std::shared_ptr<const SubmapHierarchy> submaps_;
  std::shared_ptr<const FrozenMap> frozen_;  ///< the last of the run
};

}  // namespace active_matching_slam
