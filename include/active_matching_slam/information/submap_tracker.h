#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "active_matching_slam/information/submap_hierarchy.h"

namespace active_matching_slam {

/// Gives clusters the same label from frame to frame, level by level, so that they keep their
/// identity (and their colour) while features come and go and the tree changes.
///
/// A cluster takes the label of which it holds the most features; the largest overlap is served
/// first, ties by the lower label, then by the cluster's lowest id; each label is given once. A
/// cluster without one gets the lowest label that is not in use and was not in the frame before.
/// Labels are so small numbers from 0, but not without gaps.
class SubmapTracker {
 public:
  /// Renames the labels of every level, and of the requested partition.
  void relabel(SubmapHierarchy& hierarchy);
  void clear();

 private:
  using Labels = std::map<std::int64_t, int>;

  /// Per level the label of each feature; a level that a frame lacks is remembered.
  std::vector<Labels> labels_;
  Labels requested_;
};

}  // namespace active_matching_slam
