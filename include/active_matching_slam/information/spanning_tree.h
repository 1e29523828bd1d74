#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

namespace active_matching_slam {

/// An edge of a graph whose nodes count from 0.
struct WeightedEdge {
  int first = 0, second = 0;  ///< first < second
  double weight = 0.0;
};

/// The one order of edges that every algorithm here uses: the greater weight first, equal weights
/// by the lower (first, second). It is strict, so the maximum spanning forest is unique, and Prim,
/// Kruskal and Boruvka agree on it whatever the ties.
inline bool strongerEdge(const WeightedEdge& a, const WeightedEdge& b) {
  if (a.weight != b.weight) return a.weight > b.weight;
  return a.first != b.first ? a.first < b.first : a.second < b.second;
}

/// Prim's algorithm on a dense graph of `nodes` nodes, O(nodes^2). `weight(i, j)` is asked once for
/// each pair at most and is symmetric; what is not greater than 0 (NaN too) is no edge, so the
/// result may be a forest. Edges are sorted by (first, second).
template <typename Weight>
std::vector<WeightedEdge> maximumSpanningForestDense(int nodes, Weight&& weight);

/// The same for a symmetric matrix of weights (the diagonal is not looked at). Throws
/// std::invalid_argument unless it is square.
std::vector<WeightedEdge> maximumSpanningForest(const Eigen::MatrixXd& weights);

/// A link of the forest and the round of Boruvka's algorithm (1, 2, ...) that took it.
struct BoruvkaLink {
  WeightedEdge edge;
  int edge_index = 0;  ///< of the edges given
  int round = 0;
};

/// Boruvka's algorithm on a sparse graph, O(E log nodes) (Boruvka 1926). Each round every cluster
/// of nodes takes its strongest outgoing edge and linked clusters merge, until no edge leads out of
/// any: all links together are the maximum spanning forest. Edges of weight not greater than 0 (NaN
/// too) are none. Links are sorted by round, then the strongest first. Throws std::invalid_argument
/// unless 0 <= first < second < nodes.
std::vector<BoruvkaLink> boruvkaRounds(int nodes, const std::vector<WeightedEdge>& edges);

/// Connected components that can only grow.
class DisjointSets {
 public:
  explicit DisjointSets(int nodes);
  int find(int node);
  /// False when both were in one set already. The root of the union is the lower of both roots, so
  /// a set's root is its lowest node.
  bool unite(int a, int b);
  /// Per node the number of its set: 0, 1, ... in order of the sets' lowest nodes.
  std::vector<int> labels();
  int count() const { return count_; }

 private:
  std::vector<int> parent_;
  int count_;
};

void sortEdges(std::vector<WeightedEdge>& edges);

template <typename Weight>
std::vector<WeightedEdge> maximumSpanningForestDense(int nodes, Weight&& weight) {
  std::vector<WeightedEdge> edges;
  std::vector<WeightedEdge> strongest(
      nodes);  // of each outside node, into the tree; weight 0: none
  std::vector<int> outside;
  for (int node = 1; node < nodes; ++node) outside.push_back(node);
  for (int added = 0; !outside.empty();) {
    std::size_t best = 0;
    for (std::size_t k = 0; k < outside.size(); ++k) {
      const int node = outside[k];
      const WeightedEdge edge{std::min(added, node), std::max(added, node), weight(added, node)};
      if (edge.weight > 0.0 && strongerEdge(edge, strongest[node])) strongest[node] = edge;
      if (strongerEdge(strongest[node], strongest[outside[best]])) best = k;
    }
    added = outside[best];
    if (strongest[added].weight > 0.0) edges.push_back(strongest[added]);
    outside.erase(outside.begin() + static_cast<std::ptrdiff_t>(best));
  }
  sortEdges(edges);
  return edges;
}

}  // namespace active_matching_slam
