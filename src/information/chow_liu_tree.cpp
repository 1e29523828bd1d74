#include "active_matching_slam/information/chow_liu_tree.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/information/pair_dependence.h"

namespace active_matching_slam {
namespace {

using Eigen::Matrix2d;
using MatrixRef = Eigen::Ref<const Eigen::MatrixXd>;

std::vector<Whitening> whitenings(const std::vector<Matrix2d>& marginals) {
  std::vector<Whitening> result;
  result.reserve(marginals.size());
  for (const Matrix2d& marginal : marginals) result.push_back(Whitening::of(marginal));
  return result;
}

int featureCount(const MatrixRef& S) {
  if (S.rows() == S.cols() && S.rows() % 2 == 0) return static_cast<int>(S.rows()) / 2;
  throw std::invalid_argument("S is " + std::to_string(S.rows()) + " x " +
                              std::to_string(S.cols()) +
                              ", allowed: square with an even number of rows");
}

/// (I - C C^T)^-1 - I, what a neighbour of whitened cross covariance C adds to a node's whitened
/// precision.
Matrix2d addedPrecision(Matrix2d C) {
  constexpr double kDetermined = 1e-20;
  constexpr double kShortOf = 1.0 - 1e-9;
  Matrix2d G = C * C.transpose();
  Matrix2d left = Matrix2d::Identity() - G;
  if (left.determinant() < kDetermined) {
    C *= kShortOf;
    G = C * C.transpose();
    left = Matrix2d::Identity() - G;
  }
  if (!(left.determinant() > 0.0 && left.trace() > 0.0)) return Matrix2d::Zero();
  return left.inverse() * G;
}

}  // namespace

ChowLiuTree treeOf(const MatrixRef& S, std::vector<WeightedEdge> edges) {
  const int features = featureCount(S);
  ChowLiuTree tree;
  tree.marginals.reserve(features);
  for (int i = 0; i < features; ++i) tree.marginals.push_back(S.block<2, 2>(2 * i, 2 * i));
  tree.cross_covariances.reserve(edges.size());
  for (const WeightedEdge& edge : edges) {
    if (edge.first < 0 || edge.first >= edge.second || edge.second >= features) {
      throw std::invalid_argument("edge (" + std::to_string(edge.first) + ", " +
                                  std::to_string(edge.second) +
                                  "), allowed: 0 <= first < second < " + std::to_string(features));
    }
    tree.cross_covariances.push_back(S.block<2, 2>(2 * edge.first, 2 * edge.second));
  }
  tree.edges = std::move(edges);
  return tree;
}

ChowLiuTree chowLiuTree(const MatrixRef& S) {
  const int features = featureCount(S);
  std::vector<Whitening> points;
  points.reserve(features);
  for (int i = 0; i < features; ++i) points.push_back(Whitening::of(S.block<2, 2>(2 * i, 2 * i)));
  // The odds order pairs as their bits do, without a logarithm a pair.
  std::vector<WeightedEdge> edges = maximumSpanningForestDense(features, [&](int i, int k) {
    if (i > k) std::swap(i, k);
    const double odds = dependenceOdds(points[i], points[k], S(2 * i, 2 * k), S(2 * i + 1, 2 * k),
                                       S(2 * i, 2 * k + 1), S(2 * i + 1, 2 * k + 1));
    return std::isfinite(odds) ? odds : 0.0;
  });
  for (WeightedEdge& edge : edges) edge.weight = oddsToBits(edge.weight);
  return treeOf(S, std::move(edges));
}

std::vector<Matrix2d> treePrecision(const ChowLiuTree& tree) {
  const std::vector<Whitening> points = whitenings(tree.marginals);
  std::vector<Matrix2d> precision(tree.size());
  for (int i = 0; i < tree.size(); ++i) {
    precision[i].setZero();
    if (points[i].usable) precision[i].setIdentity();
  }
  for (std::size_t e = 0; e < tree.edges.size(); ++e) {
    const int i = tree.edges[e].first, k = tree.edges[e].second;
    if (!points[i].usable || !points[k].usable) continue;
    const Matrix2d C =
        points[i].matrix() * tree.cross_covariances[e] * points[k].matrix().transpose();
    precision[i] += addedPrecision(C);
    precision[k] += addedPrecision(C.transpose());
  }
  for (int i = 0; i < tree.size(); ++i) {
    const Matrix2d W = points[i].matrix();
    precision[i] = W.transpose() * precision[i] * W;
  }
  return precision;
}

Eigen::VectorXd treeInformationBits(const ChowLiuTree& tree) {
  const std::vector<Matrix2d> precision = treePrecision(tree);
  Eigen::VectorXd bits(tree.size());
  for (int i = 0; i < tree.size(); ++i) {
    bits(i) = informationBits(tree.marginals[i].determinant(), precision[i].determinant());
  }
  return bits;
}

std::optional<double> treeDivergenceBits(const MatrixRef& S, const ChowLiuTree& tree) {
  std::optional<double> lost = entropyBits(S);
  if (!lost) return std::nullopt;
  *lost = -*lost;
  for (const Matrix2d& marginal : tree.marginals) {
    const std::optional<double> entropy = entropyBits(marginal);
    if (!entropy) return std::nullopt;
    *lost += *entropy;
  }
  for (const WeightedEdge& edge : tree.edges)
    *lost -= pairInformationBits(S, edge.first, edge.second);
  return std::max(0.0, *lost);
}

Eigen::MatrixXd treeCovariance(const ChowLiuTree& tree) {
  const int features = tree.size();
  std::vector<std::vector<std::pair<int, Matrix2d>>> neighbours(features);  // node, S_node,here
  for (std::size_t e = 0; e < tree.edges.size(); ++e) {
    const WeightedEdge& edge = tree.edges[e];
    neighbours[edge.first].emplace_back(edge.second, tree.cross_covariances[e].transpose());
    neighbours[edge.second].emplace_back(edge.first, tree.cross_covariances[e]);
  }
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(2 * features, 2 * features);
  for (int root = 0; root < features; ++root) {
    // Outwards from the root: S_next,root = S_next,here S_here^-1 S_here,root.
    S.block<2, 2>(2 * root, 2 * root) = tree.marginals[root];
    std::vector<std::pair<int, int>> reached = {{root, -1}};  // node, where it was reached from
    for (std::size_t k = 0; k < reached.size(); ++k) {
      const auto [here, before] = reached[k];
      const Matrix2d gain = tree.marginals[here].inverse() * S.block<2, 2>(2 * here, 2 * root);
      for (const auto& [next, cross] : neighbours[here]) {
        if (next == before) continue;
        S.block<2, 2>(2 * next, 2 * root) = cross * gain;
        reached.emplace_back(next, here);
      }
    }
  }
  return S;
}

}  // namespace active_matching_slam
