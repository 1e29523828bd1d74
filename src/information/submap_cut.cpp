#include "active_matching_slam/information/submap_cut.h"

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace active_matching_slam {
namespace {

constexpr int kMostSweeps = 20;      ///< of exchanges
constexpr double kLeastGain = 1e-9;  ///< of an exchange, of all information
constexpr int kNone = -1;

/// A cut of the link from a node to its parent, and by how much it changes what is preserved.
struct Cut {
  int node = kNone;
  double change_bits = -std::numeric_limits<double>::infinity();
};

/// The hierarchy's merges, and links without information that join what is not connected where
/// features were initialised one after the other: close ids first.
std::vector<SubmapMerge> connectedMerges(const SubmapHierarchy& hierarchy) {
  const int nodes = static_cast<int>(hierarchy.ids.size());
  std::vector<SubmapMerge> merges = hierarchy.merges;
  DisjointSets sets(nodes);
  for (const SubmapMerge& merge : merges) sets.unite(merge.first, merge.second);
  std::vector<WeightedEdge> joints;
  for (int i = 0; i + 1 < nodes; ++i)
    joints.push_back({i, i + 1, static_cast<double>(hierarchy.ids[i] - hierarchy.ids[i + 1])});
  std::sort(joints.begin(), joints.end(), strongerEdge);
  for (const WeightedEdge& joint : joints)
    if (sets.unite(joint.first, joint.second))
      merges.push_back({joint.first, joint.second, 0.0, 0});
  return merges;
}

/// The hierarchy's tree, each node under its parent, some links of which are cut. Not empty.
class CutTree {
 public:
  CutTree(std::vector<WeightedEdge> edges, const SubmapHierarchy& hierarchy)
      : edges_(std::move(edges)),
        nodes_(static_cast<int>(hierarchy.ids.size())),
        merges_(connectedMerges(hierarchy)) {
    grow();
    for (const WeightedEdge& edge : edges_) meeting_.push_back(meetingOf(edge));
    label();
  }

  int parts() const { return parts_; }
  bool isCut(int node) const { return is_cut_[node] != 0; }
  double preserved() const { return preservedInformation(edges_, labels_, parts_); }
  void setCut(int node, bool is_cut) {
    is_cut_[node] = is_cut ? 1 : 0;
    label();
  }

  /// The cut that costs least of those that leave no part below `least` features; of equals that of
  /// the latest merge.
  Cut best(double least) const {
    Eigen::VectorXd crossing = Eigen::VectorXd::Zero(nodes_);  // all that a cut separates [bits]
    Eigen::VectorXi size = Eigen::VectorXi::Ones(nodes_);
    // The strongest link [bits] of what hangs below a node, and of its own, to each other part;
    // among node and children the strongest and the next.
    Eigen::MatrixXd strongest = Eigen::MatrixXd::Zero(parts_, nodes_), next = strongest;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const auto& [a, b, bits] = edges_[e];
      if (!(bits > 0.0)) continue;
      if (labels_[a] == labels_[b]) {
        crossing[a] += bits;
        crossing[b] += bits;
        crossing[meeting_[e]] -= 2.0 * bits;
      } else {
        strongest(labels_[b], a) = std::max(strongest(labels_[b], a), bits);
        strongest(labels_[a], b) = std::max(strongest(labels_[a], b), bits);
      }
    }
    for (auto node = order_.rbegin(); node != order_.rend(); ++node) {
      if (isTop(*node)) continue;
      const int parent = parent_[*node];
      crossing[parent] += crossing[*node];
      size[parent] += size[*node];
      next.col(parent) =
          next.col(parent).cwiseMax(strongest.col(parent).cwiseMin(strongest.col(*node)));
      strongest.col(parent) = strongest.col(parent).cwiseMax(strongest.col(*node));
    }
    Eigen::MatrixXd outside = Eigen::MatrixXd::Zero(parts_, nodes_);  // of all not below a node
    std::vector<int> whole(nodes_);                                   // size of a node's part
    Cut best;
    for (const int node : order_) {
      whole[node] = isTop(node) ? size[node] : whole[parent_[node]];
      if (isTop(node)) continue;
      const int parent = parent_[node];
      const auto is_here = strongest.col(node).array() == strongest.col(parent).array();
      outside.col(node) =
          outside.col(parent).cwiseMax(is_here.select(next.col(parent), strongest.col(parent)));
      if (size[node] < least || whole[node] - size[node] < least) continue;
      // Of the links between the two sides the strongest stays, which is the one of the tree. To
      // other parts each side now has a strongest of its own: the weaker of them is won.
      const double change = merges_[link_[node]].information_bits - crossing[node] +
                            strongest.col(node).cwiseMin(outside.col(node)).sum();
      const bool wins_tie = change == best.change_bits && link_[node] > link_[best.node];
      if (change > best.change_bits || wins_tie) best = {node, change};
    }
    return best;
  }

  SubmapPartition partition() const {
    DisjointSets sets(nodes_);
    for (int node = 0; node < nodes_; ++node)
      if (!isTop(node)) sets.unite(node, parent_[node]);
    return partitionOf(sets, edges_);
  }

 private:
  bool isTop(int node) const { return parent_[node] == kNone || is_cut_[node] != 0; }

  void grow() {
    std::vector<std::vector<std::pair<int, int>>> neighbours(nodes_);  // and the merge's index
    for (int m = 0; m < static_cast<int>(merges_.size()); ++m) {
      neighbours[merges_[m].first].emplace_back(merges_[m].second, m);
      neighbours[merges_[m].second].emplace_back(merges_[m].first, m);
    }
    parent_.assign(nodes_, kNone);
    link_.assign(nodes_, kNone);
    depth_.assign(nodes_, 0);
    is_cut_.assign(nodes_, 0);
    order_.assign(1, 0);
    for (std::size_t at = 0; at < order_.size(); ++at) {
      const int node = order_[at];
      for (const auto& [neighbour, merge] : neighbours[node]) {
        if (neighbour == parent_[node]) continue;
        parent_[neighbour] = node;
        link_[neighbour] = merge;
        depth_[neighbour] = depth_[node] + 1;
        order_.push_back(neighbour);
      }
    }
  }

  /// The lowest node above both ends.
  int meetingOf(const WeightedEdge& edge) const {
    int a = edge.first, b = edge.second;
    while (a != b) {
      int& deeper = depth_[a] >= depth_[b] ? a : b;
      deeper = parent_[deeper];
    }
    return a;
  }

  void label() {
    labels_.resize(nodes_);
    parts_ = 0;
    for (const int node : order_) labels_[node] = isTop(node) ? parts_++ : labels_[parent_[node]];
  }

  std::vector<WeightedEdge> edges_;
  int nodes_;
  std::vector<SubmapMerge> merges_;
  std::vector<int> order_;   ///< parents first, from node 0 on
  std::vector<int> parent_;  ///< per node; kNone of the first
  std::vector<int> link_;    ///< per node, the merge with its parent; kNone of the first
  std::vector<int> depth_;
  std::vector<char> is_cut_;  ///< per node, the link to its parent
  std::vector<int> meeting_;  ///< per edge
  std::vector<int> labels_;   ///< per node
  int parts_ = 0;
};

}  // namespace

SubmapPartition cutIntoSubmaps(const MutualInformationGraph& graph,
                               const SubmapHierarchy& hierarchy, int submaps) {
  const int features = static_cast<int>(hierarchy.ids.size());
  SubmapPartition by_rounds = partitionIntoSubmaps(graph, hierarchy, submaps);  // checks them
  if (submaps >= features) return by_rounds;

  std::vector<WeightedEdge> edges = graphEdges(graph);
  double total_bits = 0.0;
  for (const WeightedEdge& edge : edges) total_bits += std::max(0.0, edge.weight);
  CutTree tree(std::move(edges), hierarchy);
  double least = features / (3.0 * submaps - 2.0);
  while (tree.parts() < submaps) {
    const Cut cut = tree.best(least);
    if (cut.node == kNone) {
      least /= 2.0;
    } else {
      tree.setCut(cut.node, true);
    }
  }
  double preserved = tree.preserved();
  bool has_gained = true;
  for (int sweep = 0; sweep < kMostSweeps && has_gained; ++sweep) {
    has_gained = false;
    for (int node = 0; node < features; ++node) {
      if (!tree.isCut(node)) continue;
      tree.setCut(node, false);
      const Cut cut = tree.best(least);
      const bool gains = cut.node != kNone &&
                         tree.preserved() + cut.change_bits / total_bits > preserved + kLeastGain;
      tree.setCut(gains ? cut.node : node, true);
      if (!gains) continue;
      preserved = tree.preserved();
      has_gained = true;
    }
  }
  return tree.partition();
}

SubmapLevel levelOf(SubmapPartition cut, const MutualInformationGraph& graph) {
  return levelOfLabels(std::move(cut.submap_of_feature), cut.submaps, graphEdges(graph));
}

}  // namespace active_matching_slam
