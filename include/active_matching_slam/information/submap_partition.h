#pragma once

#include <vector>

#include "active_matching_slam/information/submap_hierarchy.h"

namespace active_matching_slam {

/// Partitions on request, all from the tree of one hierarchy.
///
/// The tree's links in the order of SubmapHierarchy::merges (by Boruvka's round, then the strongest
/// first) are a merge sequence: after each link there is one cluster less, and after the links of
/// round h there is level h. So the sequence holds the levels and every number of submaps between
/// them. Cutting the tree's weakest links instead would leave single features alone (Chli 2009,
/// section 6.4).
struct SubmapPartition {
  std::vector<int> submap_of_feature;  ///< per entry of ids; 0, 1, ... by each cluster's lowest id
  int submaps = 0;
  double preserved = 1.0;  ///< preservedInformation() of it
};

/// The partition whose submaps are the sets, in the graph of these edges.
SubmapPartition partitionOf(DisjointSets& sets, const std::vector<WeightedEdge>& edges);

/// `graph` must be the one that the hierarchy was built of. These throw std::invalid_argument when
/// it has other ids, and naming a request out of its range.

/// The first partition of the sequence with `submaps` clusters: 1 or more. Fewer than the graph has
/// connected parts, or more than it has features, can't be: the nearest possible number is
/// returned.
SubmapPartition partitionIntoSubmaps(const MutualInformationGraph& graph,
                                     const SubmapHierarchy& hierarchy, int submaps);

/// The most submaps that preserve at least `fraction` of the information, in [0, 1], of all
/// partitions of the sequence from level 1 on. (At level 0 nothing is lost and nothing is grouped.)
/// The last level preserves all, so there is always one.
SubmapPartition partitionPreserving(const MutualInformationGraph& graph,
                                    const SubmapHierarchy& hierarchy, double fraction);

/// Submaps of at most `features` (1 or more) features each: the merge sequence, leaving out each
/// merge that would make a larger one.
SubmapPartition partitionLimitingSize(const MutualInformationGraph& graph,
                                      const SubmapHierarchy& hierarchy, int features);

}  // namespace active_matching_slam
