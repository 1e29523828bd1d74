#include "active_matching_slam/information/spanning_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;

/// Symmetric; `levels` distinct weights (few: many ties), a fraction `density` of them not 0.
MatrixXd randomWeights(int nodes, unsigned seed, int levels, double density) {
  std::mt19937 generator(seed);
  MatrixXd weights = MatrixXd::Zero(nodes, nodes);
  for (int k = 0; k < nodes; ++k) {
    for (int i = 0; i < k; ++i) {
      if (generator() % 1000 >= 1000 * density) continue;
      weights(i, k) = weights(k, i) = 0.25 * (1 + generator() % levels);
    }
  }
  return weights;
}

std::vector<WeightedEdge> edgesOf(const MatrixXd& weights) {
  std::vector<WeightedEdge> edges;
  for (int i = 0; i < weights.rows(); ++i) {
    for (int k = i + 1; k < weights.cols(); ++k) edges.push_back({i, k, weights(i, k)});
  }
  return edges;
}

/// Independent of both algorithms: an edge is in the maximum forest exactly if no path of stronger
/// edges joins its ends (the cycle property).
std::vector<WeightedEdge> forestByCycleProperty(const MatrixXd& weights) {
  std::vector<WeightedEdge> forest;
  const int nodes = static_cast<int>(weights.rows());
  for (const WeightedEdge& edge : edgesOf(weights)) {
    if (!(edge.weight > 0.0)) continue;
    std::vector<char> reached(nodes, 0);
    std::vector<int> open = {edge.first};
    reached[edge.first] = 1;
    while (!open.empty()) {
      const int node = open.back();
      open.pop_back();
      for (int next = 0; next < nodes; ++next) {
        if (next == node || reached[next]) continue;
        const WeightedEdge step{std::min(node, next), std::max(node, next), weights(node, next)};
        if (!(step.weight > 0.0) || !strongerEdge(step, edge)) continue;
        reached[next] = 1;
        open.push_back(next);
      }
    }
    if (!reached[edge.second]) forest.push_back(edge);
  }
  return forest;
}

/// Kruskal's algorithm, with labels repainted at every merge.
std::vector<WeightedEdge> forestByKruskal(int nodes, std::vector<WeightedEdge> edges) {
  std::stable_sort(edges.begin(), edges.end(), strongerEdge);
  std::vector<int> colour(nodes);
  for (int node = 0; node < nodes; ++node) colour[node] = node;
  std::vector<WeightedEdge> forest;
  for (const WeightedEdge& edge : edges) {
    const int from = colour[edge.second], to = colour[edge.first];
    if (!(edge.weight > 0.0) || from == to) continue;
    forest.push_back(edge);
    std::replace(colour.begin(), colour.end(), from, to);
  }
  sortEdges(forest);
  return forest;
}

std::vector<WeightedEdge> forestByBoruvka(int nodes, const std::vector<WeightedEdge>& edges) {
  std::vector<WeightedEdge> forest;
  for (const BoruvkaLink& link : boruvkaRounds(nodes, edges)) {
    const WeightedEdge& given = edges[link.edge_index];
    EXPECT_EQ(given.first, link.edge.first);
    EXPECT_EQ(given.second, link.edge.second);
    forest.push_back(link.edge);
  }
  sortEdges(forest);
  return forest;
}

void expectSame(const std::vector<WeightedEdge>& a, const std::vector<WeightedEdge>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t e = 0; e < a.size(); ++e) {
    EXPECT_EQ(a[e].first, b[e].first);
    EXPECT_EQ(a[e].second, b[e].second);
    EXPECT_DOUBLE_EQ(a[e].weight, b[e].weight);
  }
}

TEST(SpanningTree, PrimBoruvkaKruskalAndTheCyclePropertyAgree) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    const int levels = seed % 3 == 0 ? 1 : (seed % 3 == 1 ? 3 : 1000000);
    const double density = seed % 2 ? 1.0 : 0.12;
    const MatrixXd weights = randomWeights(2 + seed % 23, seed, levels, density);
    SCOPED_TRACE(seed);
    const auto prim = maximumSpanningForest(weights);
    expectSame(prim, forestByCycleProperty(weights));
    const int nodes = static_cast<int>(weights.rows());
    expectSame(prim, forestByKruskal(nodes, edgesOf(weights)));
    expectSame(prim, forestByBoruvka(nodes, edgesOf(weights)));
  }
}

TEST(SpanningTree, EveryBoruvkaRoundTakesTheStrongestLinkOutOfEachCluster) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    const MatrixXd weights = randomWeights(17, seed, seed % 2 ? 2 : 1000000, seed % 3 ? 1.0 : 0.15);
    const std::vector<WeightedEdge> edges = edgesOf(weights);
    const std::vector<BoruvkaLink> links = boruvkaRounds(17, edges);
    std::vector<int> cluster(17);
    for (int node = 0; node < 17; ++node) cluster[node] = node;
    const int rounds = links.empty() ? 0 : links.back().round;
    for (int round = 1; round <= rounds; ++round) {
      std::vector<WeightedEdge> expected, taken;
      for (int c = 0; c < 17; ++c) {
        const WeightedEdge* best = nullptr;
        for (const WeightedEdge& edge : edges) {
          const bool leads_out = (cluster[edge.first] == c) != (cluster[edge.second] == c);
          if (!leads_out || !(edge.weight > 0.0)) continue;
          if (best == nullptr || strongerEdge(edge, *best)) best = &edge;
        }
        if (best != nullptr) expected.push_back(*best);
      }
      sortEdges(expected);
      expected.erase(std::unique(expected.begin(), expected.end(),
                                 [](const WeightedEdge& a, const WeightedEdge& b) {
                                   return a.first == b.first && a.second == b.second;
                                 }),
                     expected.end());
      for (const BoruvkaLink& link : links) {
        if (link.round == round) taken.push_back(link.edge);
      }
      EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end(), strongerEdge));
      sortEdges(taken);
      expectSame(taken, expected);
      for (const WeightedEdge& edge : taken) {
        std::replace(cluster.begin(), cluster.end(), int{cluster[edge.second]},
                     int{cluster[edge.first]});
      }
    }
  }
}

TEST(SpanningTree, TiesGoToTheLowerPair) {
  const auto edges = maximumSpanningForest(MatrixXd::Ones(4, 4));
  ASSERT_EQ(edges.size(), 3u);
  for (int e = 0; e < 3; ++e) {
    EXPECT_EQ(edges[e].first, 0);
    EXPECT_EQ(edges[e].second, e + 1);
  }
}

TEST(SpanningTree, NothingOneNodeAndNoLinksGiveNoEdges) {
  EXPECT_TRUE(maximumSpanningForest(MatrixXd(0, 0)).empty());
  EXPECT_TRUE(maximumSpanningForest(MatrixXd::Ones(1, 1)).empty());
  EXPECT_TRUE(maximumSpanningForest(MatrixXd::Zero(5, 5)).empty());
  EXPECT_TRUE(boruvkaRounds(0, {}).empty());
  EXPECT_TRUE(boruvkaRounds(3, {}).empty());
}

TEST(SpanningTree, WhatIsNotPositiveIsNoEdge) {
  MatrixXd weights = MatrixXd::Constant(3, 3, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(maximumSpanningForest(weights).empty());
  EXPECT_TRUE(boruvkaRounds(3, edgesOf(weights)).empty());
  weights(1, 2) = weights(2, 1) = 0.5;
  weights(0, 1) = weights(1, 0) = -1.0;
  const auto edges = maximumSpanningForest(weights);
  ASSERT_EQ(edges.size(), 1u);
  EXPECT_EQ(edges[0].first, 1);
  EXPECT_EQ(edges[0].second, 2);
}

TEST(SpanningTree, SaysWhatIsWrong) {
  EXPECT_THROW(maximumSpanningForest(MatrixXd::Zero(2, 3)), std::invalid_argument);
  EXPECT_THROW(boruvkaRounds(2, {{1, 1, 1.0}}), std::invalid_argument);
  EXPECT_THROW(boruvkaRounds(2, {{0, 2, 1.0}}), std::invalid_argument);
  EXPECT_THROW(boruvkaRounds(2, {{-1, 1, 1.0}}), std::invalid_argument);
}

TEST(DisjointSets, KnowWhatIsConnectedAndNameItByTheLowestNode) {
  DisjointSets sets(6);
  EXPECT_TRUE(sets.unite(5, 3));
  EXPECT_TRUE(sets.unite(3, 4));
  EXPECT_FALSE(sets.unite(4, 5));
  EXPECT_EQ(sets.find(5), 3);
  EXPECT_EQ(sets.find(0), 0);
  EXPECT_EQ(sets.count(), 4);
  EXPECT_EQ(sets.labels(), (std::vector<int>{0, 1, 2, 3, 3, 3}));
}

}  // namespace
}  // namespace active_matching_slam
