#include "active_matching_slam/information/submap_hierarchy.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>

namespace active_matching_slam {
namespace {

void checkLabels(const std::vector<int>& labels, int clusters) {
  for (int label : labels) {
    if (label >= 0 && label < clusters) continue;
    throw std::invalid_argument("label " + std::to_string(label) + ", allowed: 0 to " +
                                std::to_string(clusters - 1));
  }
}

}  // namespace

SubmapLevel levelOfLabels(std::vector<int> labels, int submaps,
                          const std::vector<WeightedEdge>& edges) {
  const int features = static_cast<int>(labels.size());
  SubmapLevel level;
  level.submap_of_feature = std::move(labels);
  level.submaps = submaps;
  if (level.submaps == features || level.submaps == 1) return level;  // nothing is cut
  level.preserved_chow_liu = preservedInformation(edges, level.submap_of_feature, level.submaps);
  level.preserved_naive =
      preservedInformation(edges, naivePartition(features, level.submaps), level.submaps);
  return level;
}

SubmapHierarchy buildSubmapHierarchy(MutualInformationGraph& graph) {
  const std::vector<WeightedEdge> edges = graphEdges(graph);
  const int features = static_cast<int>(graph.ids.size());
  SubmapHierarchy hierarchy;
  hierarchy.ids = graph.ids;
  for (InformationLink& link : graph.links) link.in_tree = false;
  for (const BoruvkaLink& link : boruvkaRounds(features, edges)) {
    graph.links[link.edge_index].in_tree = true;
    hierarchy.merges.push_back({link.edge.first, link.edge.second, link.edge.weight, link.round});
  }
  DisjointSets sets(features);
  hierarchy.levels.push_back(levelOfLabels(sets.labels(), sets.count(), edges));
  for (std::size_t m = 0; m < hierarchy.merges.size(); ++m) {
    const SubmapMerge& merge = hierarchy.merges[m];
    sets.unite(merge.first, merge.second);
    const bool level_done =
        m + 1 == hierarchy.merges.size() || hierarchy.merges[m + 1].level != merge.level;
    if (level_done) hierarchy.levels.push_back(levelOfLabels(sets.labels(), sets.count(), edges));
  }
  return hierarchy;
}

double preservedInformation(const std::vector<WeightedEdge>& edges, const std::vector<int>& labels,
                            int clusters) {
  checkLabels(labels, clusters);
  // The strongest link so far between each two clusters: a table where that is no larger than the
  // graph itself, so that memory stays proportional to the links.
  const std::size_t width = static_cast<std::size_t>(clusters);
  const bool small = width * width <= 4 * edges.size();
  std::vector<double> table(small ? width * width : 0, 0.0);
  std::unordered_map<std::size_t, double> sparse;
  double total = 0.0, kept = 0.0;
  for (const WeightedEdge& edge : edges) {
    if (!(edge.weight > 0.0)) continue;
    total += edge.weight;
    const int a = labels[edge.first], b = labels[edge.second];
    if (a == b) {
      kept += edge.weight;
      continue;
    }
    const std::size_t pair = std::min(a, b) * width + std::max(a, b);
    double& strongest = small ? table[pair] : sparse[pair];
    if (edge.weight <= strongest) continue;
    kept += edge.weight - strongest;
    strongest = edge.weight;
  }
  return total > 0.0 ? std::min(1.0, kept / total) : 1.0;
}

std::vector<char> preservedLinks(const std::vector<WeightedEdge>& edges,
                                 const std::vector<int>& labels, int clusters) {
  checkLabels(labels, clusters);
  std::vector<char> kept(edges.size(), 0);
  std::map<std::pair<int, int>, std::size_t> strongest;  // between two clusters, index of the edge
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const int a = labels[edges[e].first], b = labels[edges[e].second];
    if (!(edges[e].weight > 0.0)) continue;
    if (a == b) {
      kept[e] = 1;
      continue;
    }
    const auto [at, is_first] = strongest.emplace(std::minmax(a, b), e);
    if (!is_first && edges[e].weight > edges[at->second].weight) at->second = e;
  }
  for (const auto& link : strongest) kept[link.second] = 1;
  return kept;
}

std::vector<int> naivePartition(int features, int clusters) {
  std::vector<int> labels(features);
  for (int i = 0; i < features; ++i) {
    labels[i] = static_cast<int>(static_cast<std::int64_t>(i) * clusters / features);
  }
  return labels;
}

}  // namespace active_matching_slam
