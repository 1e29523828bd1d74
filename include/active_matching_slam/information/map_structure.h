#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "active_matching_slam/information/mutual_information_accumulator.h"
#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/information/requested_submaps.h"
#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/information/submap_tracker.h"

namespace active_matching_slam {

/// The structure of the map while it grows, with what has left it: the MI graph, its tree, and the
/// hierarchy of submaps with labels that persist. Frames in, snapshots out.
class MapStructure {
 public:
  /// As MutualInformationAccumulator's.
  void addFrame(const std::vector<std::int64_t>& ids, const Eigen::Ref<const Eigen::MatrixXd>& S);
  void forgetWeakest(const std::vector<std::int64_t>& ids, int most);
  void clear();
  /// The next frame begins the averages anew, for what came before was of a map that turned out to
  /// be another. Labels go on from those of the snapshot before.
  void restartAverages() { is_outdated_ = true; }

  struct Snapshot {
    std::shared_ptr<const MutualInformationGraph> graph;
    std::shared_ptr<const SubmapHierarchy> submaps;
  };
  /// The structure as it is now, with the partition that `options` ask for; never null. Labels
  /// follow from those of the snapshot before.
  Snapshot snapshot(const SubmapOptions& options = {});

  /// The graph so far; its tree is not marked.
  MutualInformationGraph graph() const { return accumulator_.links(); }

  /// Goes on from a stored graph. Throws std::invalid_argument and changes nothing.
  void restore(const MutualInformationGraph& graph);

 private:
  MutualInformationAccumulator accumulator_;
  SubmapTracker tracker_;
  bool is_outdated_ = false;  ///< what the accumulator holds
};

}  // namespace active_matching_slam
