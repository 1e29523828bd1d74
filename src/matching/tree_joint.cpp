#include <Eigen/LU>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "joint.h"

namespace active_matching_slam {
namespace {

struct TreeConditional : ConditionalJoint {
  std::vector<Eigen::Matrix2d> edge;  ///< S_ij of each edge, i = first, j = second
};

Eigen::VectorXd determinantsOf(const std::vector<Eigen::Matrix2d>& blocks) {
  Eigen::VectorXd determinants(static_cast<Eigen::Index>(blocks.size()));
  for (std::size_t i = 0; i < blocks.size(); ++i)
    determinants(static_cast<Eigen::Index>(i)) = blocks[i].determinant();
  return determinants;
}

class TreeJoint : public Joint {
 public:
  TreeJoint(const ChowLiuTree& tree, const Eigen::VectorXd& noise_variances)
      : Joint(noise_variances, determinantsOf(treePrecision(tree))),
        neighbours_(tree.marginals.size()) {
    auto prior = std::make_shared<TreeConditional>();
    marginalsOf(*prior).resize(tree.marginals.size());
    measuredOf(*prior).assign(tree.marginals.size(), 0);
    for (int f = 0; f < size(); ++f)
      setMarginal(*prior, f, tree.marginals[static_cast<std::size_t>(f)]);
    prior->edge = tree.cross_covariances;
    for (std::size_t e = 0; e < tree.edges.size(); ++e) {
      const WeightedEdge& edge = tree.edges[e];
      neighbours_[static_cast<std::size_t>(edge.first)].push_back({edge.second, e, false});
      neighbours_[static_cast<std::size_t>(edge.second)].push_back({edge.first, e, true});
    }
    setPrior(prior);
  }

 private:
  struct Neighbour {
    int node;
    std::size_t edge;
    bool is_first;  ///< of the edge
  };
  /// A node whose marginal has changed, to be passed on to its neighbours.
  struct Message {
    int node, from;
    Eigen::Matrix2d old_precision, shrinkage, cross;  // S^-1 before, S before - S after
  };

  std::shared_ptr<ConditionalJoint> derive(const std::shared_ptr<const ConditionalJoint>& base,
                                           int feature) const override {
    const auto& given = static_cast<const TreeConditional&>(*base);
    auto derived = std::make_shared<TreeConditional>();
    inherit(*derived, given, feature);
    derived->edge = given.edge;
    const Eigen::Matrix2d& measured = given.marginal(feature).covariance;
    std::vector<Message> pending = {{feature, -1, measured.inverse(), measured, measured}};
    while (!pending.empty()) {
      const Message message = pending.back();
      pending.pop_back();
      for (const Neighbour& k : neighbours_[static_cast<std::size_t>(message.node)]) {
        // An edge of a measured feature is cut.
        if (k.node == message.from || derived->isMeasured(k.node)) continue;
        pending.push_back(pass(message, k, given, *derived));
      }
    }
    return derived;
  }

  /// J -> K: B = S_KJ S_JJ^-1, S_KK -= B (S_JJ - S_JJ') B^T, S_KJ' = B S_JJ'.
  Message pass(const Message& from, const Neighbour& k, const TreeConditional& given,
               TreeConditional& derived) const {
    Eigen::Matrix2d& edge = derived.edge[k.edge];
    const Eigen::Matrix2d S_kj = k.is_first ? edge : Eigen::Matrix2d(edge.transpose());
    const Eigen::Matrix2d B = S_kj * from.old_precision;
    const Eigen::Matrix2d& before = given.marginal(k.node).covariance;
    Eigen::Matrix2d shrinkage = B * from.shrinkage * B.transpose();
    shrinkage(0, 1) = shrinkage(1, 0);
    setMarginal(derived, k.node, before - shrinkage);
    if (from.from >= 0) {  // else the edge is cut
      const Eigen::Matrix2d S_kj_after = S_kj - B * from.shrinkage;
      edge = k.is_first ? S_kj_after : Eigen::Matrix2d(S_kj_after.transpose());
    }
    const Eigen::Matrix2d cross = B * from.cross;
    touchedOf(derived).push_back(k.node);
    crossOf(derived).push_back(cross);
    return {k.node, from.node, before.inverse(), shrinkage, cross};
  }

  std::vector<std::vector<Neighbour>> neighbours_;
};

}  // namespace

std::unique_ptr<Joint> makeTreeJoint(const ChowLiuTree& tree,
                                     const Eigen::VectorXd& noise_variances) {
  return std::make_unique<TreeJoint>(tree, noise_variances);
}

}  // namespace active_matching_slam
