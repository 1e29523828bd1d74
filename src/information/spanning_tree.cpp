#include "active_matching_slam/information/spanning_tree.h"

#include <numeric>
#include <stdexcept>
#include <string>

namespace active_matching_slam {

DisjointSets::DisjointSets(int nodes) : parent_(nodes), count_(nodes) {
  std::iota(parent_.begin(), parent_.end(), 0);
}

int DisjointSets::find(int node) {
  while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
  return node;
}

bool DisjointSets::unite(int a, int b) {
  a = find(a);
  b = find(b);
  if (a == b) return false;
  parent_[std::max(a, b)] = std::min(a, b);
  --count_;
  return true;
}

std::vector<int> DisjointSets::labels() {
  std::vector<int> labels(parent_.size());
  int next = 0;
  for (int node = 0; node < static_cast<int>(parent_.size()); ++node) {
    // The root is the lowest of its set, so it has its label before any other asks.
    const int root = find(node);
    labels[node] = root == node ? next++ : labels[root];
  }
  return labels;
}

void sortEdges(std::vector<WeightedEdge>& edges) {
  std::sort(edges.begin(), edges.end(), [](const WeightedEdge& a, const WeightedEdge& b) {
    return a.first != b.first ? a.first < b.first : a.second < b.second;
  });
}

std::vector<WeightedEdge> maximumSpanningForest(const Eigen::MatrixXd& weights) {
  if (weights.rows() != weights.cols()) {
    throw std::invalid_argument("weights is " + std::to_string(weights.rows()) + " x " +
                                std::to_string(weights.cols()) + ", allowed: square");
  }
  return maximumSpanningForestDense(static_cast<int>(weights.rows()),
                                    [&](int i, int j) { return weights(j, i); });
}

std::vector<BoruvkaLink> boruvkaRounds(int nodes, const std::vector<WeightedEdge>& edges) {
  std::vector<int> open;  // edges that join two clusters
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const WeightedEdge& edge = edges[e];
    if (edge.first < 0 || edge.first >= edge.second || edge.second >= nodes) {
      throw std::invalid_argument("edge (" + std::to_string(edge.first) + ", " +
                                  std::to_string(edge.second) +
                                  "), allowed: 0 <= first < second < " + std::to_string(nodes));
    }
    if (edge.weight > 0.0) open.push_back(static_cast<int>(e));
  }
  DisjointSets sets(nodes);
  std::vector<int> cluster(nodes), strongest(nodes);
  std::iota(cluster.begin(), cluster.end(), 0);
  std::vector<BoruvkaLink> links;
  for (int round = 1; !open.empty(); ++round) {
    std::fill(strongest.begin(), strongest.end(), -1);
    for (int e : open) {
      for (int end : {cluster[edges[e].first], cluster[edges[e].second]}) {
        if (strongest[end] < 0 || strongerEdge(edges[e], edges[strongest[end]])) strongest[end] = e;
      }
    }
    const std::size_t begin = links.size();
    for (int node = 0; node < nodes; ++node) {
      const int e = strongest[node];
      if (e >= 0 && sets.unite(edges[e].first, edges[e].second))
        links.push_back({edges[e], e, round});
    }
    std::sort(
        links.begin() + static_cast<std::ptrdiff_t>(begin), links.end(),
        [](const BoruvkaLink& a, const BoruvkaLink& b) { return strongerEdge(a.edge, b.edge); });
    for (int node = 0; node < nodes; ++node) cluster[node] = sets.find(node);
    open.erase(
        std::remove_if(open.begin(), open.end(),
                       [&](int e) { return cluster[edges[e].first] == cluster[edges[e].second]; }),
        open.end());
  }
  return links;
}

}  // namespace active_matching_slam
