#pragma once

#include <cstdint>
#include <vector>

#include "active_matching_slam/information/mutual_information_graph.h"

namespace active_matching_slam {

/// One level of the hierarchy: a partition of the features.
struct SubmapLevel {
  std::vector<int>
      submap_of_feature;  ///< per entry of SubmapHierarchy::ids; labels persist in time
  int submaps = 0;
  double preserved_chow_liu = 1.0;  ///< Table 6.1
  double preserved_naive = 1.0;     ///< same number of equal clusters in order of initialisation
};

/// Two clusters become one along a link of the tree.
struct SubmapMerge {
  int first = 0, second = 0;  ///< indices of SubmapHierarchy::ids, first < second
  double information_bits = 0.0;
  int level = 0;  ///< the level that the merge belongs to, 1 or more
};

/// Boruvka's rounds over the MI graph (Chli 2009, section 6.4). Level 0: each feature alone. The
/// last level has one cluster for each connected part of the graph.
struct SubmapHierarchy {
  std::vector<std::int64_t> ids;    ///< ascending, as in the graph
  std::vector<SubmapLevel> levels;  ///< at least one
  std::vector<SubmapMerge> merges;  ///< the tree's links by level, then the strongest first
  /// The partition that a user asked for (SubmapOptions); 0 submaps: none.
  SubmapLevel requested;
};

/// Builds the hierarchy over all links of the graph and marks the graph's tree, which is made of
/// the same links. A level's labels are 0, 1, ... in order of each cluster's lowest id: see
/// SubmapTracker for labels that persist. Throws as graphEdges() does.
SubmapHierarchy buildSubmapHierarchy(MutualInformationGraph& graph);

/// A partition of the hierarchy's features, with what it and the naive one preserve. `labels` per
/// entry of ids: 0 or more and below `submaps`. Throws std::invalid_argument when they are not.
SubmapLevel levelOfLabels(std::vector<int> labels, int submaps,
                          const std::vector<WeightedEdge>& edges);

/// Fraction of the graph's information that a partition keeps: all links inside clusters and the
/// strongest link between each two clusters, over the sum of all links (Chli 2009, Table 6.1). 1
/// for a graph without information. `labels` per node, 0 or more and below `clusters`; throws
/// std::invalid_argument when they are not. O(edges + nodes).
double preservedInformation(const std::vector<WeightedEdge>& edges, const std::vector<int>& labels,
                            int clusters);

/// The links that preservedInformation() counts, per edge; of equally strong ones between two
/// clusters the first. Throws as preservedInformation() does.
std::vector<char> preservedLinks(const std::vector<WeightedEdge>& edges,
                                 const std::vector<int>& labels, int clusters);

/// `features` in `clusters` parts of equal size (to one) in order of initialisation.
std::vector<int> naivePartition(int features, int clusters);

}  // namespace active_matching_slam
