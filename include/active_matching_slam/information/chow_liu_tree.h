#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/information/spanning_tree.h"

namespace active_matching_slam {

/// The best tree-shaped approximation of a joint Gaussian of image points (Chow & Liu 1968; Chli
/// 2009, sections 6.3 and 7.3), kept as marginals and cross covariances of the edges alone.
struct ChowLiuTree {
  std::vector<WeightedEdge> edges;         ///< weight = I(z_i; z_k) [bits], by (first, second)
  std::vector<Eigen::Matrix2d> marginals;  ///< F, S_ii [px^2]
  std::vector<Eigen::Matrix2d> cross_covariances;  ///< per edge, S_ij with i = first, j = second

  int size() const { return static_cast<int>(marginals.size()); }
};

/// Maximum spanning tree of the pairwise information of S (2F x 2F), O(F^2), without a matrix of
/// it. Independent groups, and features that are not usable, stay unconnected. Throws
/// std::invalid_argument unless S is square with an even number of rows.
ChowLiuTree chowLiuTree(const Eigen::Ref<const Eigen::MatrixXd>& S);

/// The blocks that a given tree or forest needs of S. Throws std::invalid_argument on an edge that
/// is out of range.
ChowLiuTree treeOf(const Eigen::Ref<const Eigen::MatrixXd>& S, std::vector<WeightedEdge> edges);

/// Diagonal blocks of the precision matrix of the tree's distribution [px^-2], closed form over the
/// neighbours N(j):
///   L_jj = S_jj^-1 + sum_{n in N(j)} [(S_jj - S_jn S_nn^-1 S_nj)^-1 - S_jj^-1].
/// Zero for a feature that is not usable; an edge that determines a feature exactly is taken as
/// just short of it.
std::vector<Eigen::Matrix2d> treePrecision(const ChowLiuTree& tree);

/// I(z_j; all others) in the tree's distribution, 1/2 log2(|S_jj| |L_jj|), which is that of j and
/// its neighbours (section 7.4.2): F values [bits].
Eigen::VectorXd treeInformationBits(const ChowLiuTree& tree);

/// Bits lost by the tree, KL(N(S) || N(S_tree)). Both agree on the blocks of the tree, so it is the
/// total correlation of S less what the edges keep. Empty when S is not positive definite.
std::optional<double> treeDivergenceBits(const Eigen::Ref<const Eigen::MatrixXd>& S,
                                         const ChowLiuTree& tree);

/// S of the tree's distribution (2F x 2F): blocks of pairs without an edge are products along their
/// path, 0 between different trees. For tests and pictures, O(F^2).
Eigen::MatrixXd treeCovariance(const ChowLiuTree& tree);

}  // namespace active_matching_slam
