#include "active_matching_slam/information/submap_partition.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace active_matching_slam {
namespace {

void checkIds(const MutualInformationGraph& graph, const SubmapHierarchy& hierarchy) {
  if (graph.ids == hierarchy.ids) return;
  throw std::invalid_argument("graph has " + std::to_string(graph.ids.size()) +
                              " features, allowed: the " + std::to_string(hierarchy.ids.size()) +
                              " of the hierarchy");
}

}  // namespace

SubmapPartition partitionOf(DisjointSets& sets, const std::vector<WeightedEdge>& edges) {
  SubmapPartition partition;
  partition.submap_of_feature = sets.labels();
  partition.submaps = sets.count();
  partition.preserved = preservedInformation(edges, partition.submap_of_feature, partition.submaps);
  return partition;
}

SubmapPartition partitionIntoSubmaps(const MutualInformationGraph& graph,
                                     const SubmapHierarchy& hierarchy, int submaps) {
  checkIds(graph, hierarchy);
  if (submaps < 1) {
    throw std::invalid_argument("submaps is " + std::to_string(submaps) + ", allowed: 1 or more");
  }
  DisjointSets sets(static_cast<int>(hierarchy.ids.size()));
  for (const SubmapMerge& merge : hierarchy.merges) {
    if (sets.count() <= submaps) break;
    sets.unite(merge.first, merge.second);
  }
  return partitionOf(sets, graphEdges(graph));
}

SubmapPartition partitionPreserving(const MutualInformationGraph& graph,
                                    const SubmapHierarchy& hierarchy, double fraction) {
  checkIds(graph, hierarchy);
  if (!(fraction >= 0.0 && fraction <= 1.0)) {
    throw std::invalid_argument("fraction is " + std::to_string(fraction) + ", allowed: 0 to 1");
  }
  const std::vector<WeightedEdge> edges = graphEdges(graph);
  DisjointSets sets(static_cast<int>(hierarchy.ids.size()));
  for (std::size_t m = 0; m < hierarchy.merges.size(); ++m) {
    sets.unite(hierarchy.merges[m].first, hierarchy.merges[m].second);
    if (m + 1 < hierarchy.merges.size() && hierarchy.merges[m + 1].level == 1) continue;
    SubmapPartition partition = partitionOf(sets, edges);
    if (partition.preserved >= fraction) return partition;
  }
  // All links lie inside the connected parts, so nothing is lost but by rounding.
  return partitionOf(sets, edges);
}

SubmapPartition partitionLimitingSize(const MutualInformationGraph& graph,
                                      const SubmapHierarchy& hierarchy, int features) {
  checkIds(graph, hierarchy);
  if (features < 1) {
    throw std::invalid_argument("features is " + std::to_string(features) + ", allowed: 1 or more");
  }
  DisjointSets sets(static_cast<int>(hierarchy.ids.size()));
  std::vector<int> size(hierarchy.ids.size(), 1);  // of the set with this root
  for (const SubmapMerge& merge : hierarchy.merges) {
    const int a = sets.find(merge.first), b = sets.find(merge.second);
    if (size[a] + size[b] > features) continue;
    sets.unite(a, b);
    size[sets.find(a)] = size[a] + size[b];
  }
  return partitionOf(sets, graphEdges(graph));
}

}  // namespace active_matching_slam
