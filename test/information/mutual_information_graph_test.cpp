#include "active_matching_slam/information/mutual_information_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "active_matching_slam/information/gaussian_information.h"
#include "information/random_gaussian.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using test::randomMeasurementCovariance;

TEST(MutualInformationGraph, OfOneCovarianceHasItsTreeMarked) {
  const MatrixXd S = randomMeasurementCovariance(12, 3);
  std::vector<std::int64_t> ids;
  for (int i = 0; i < 12; ++i) ids.push_back(100 - i);  // descending: index 11 - i in the graph
  const MutualInformationGraph graph = informationGraph(ids, S);
  const auto edges = maximumSpanningForest(pairInformationMatrix(S));
  int marked = 0;
  for (const InformationLink& link : graph.links) {
    const int i = static_cast<int>(100 - link.second), k = static_cast<int>(100 - link.first);
    EXPECT_NEAR(link.information_bits, pairInformationBits(S, i, k), 1e-12);
    const bool in_tree = std::any_of(edges.begin(), edges.end(), [&](const WeightedEdge& edge) {
      return edge.first == i && edge.second == k;
    });
    EXPECT_EQ(link.in_tree, in_tree);
    marked += link.in_tree;
  }
  EXPECT_EQ(marked, 11);
}

TEST(MutualInformationGraph, EdgesAreChecked) {
  EXPECT_THROW(graphEdges({{1, 1}, {}}), std::invalid_argument);
  EXPECT_THROW(graphEdges({{1, 2}, {{2, 1, 1.0, 1, false}}}), std::invalid_argument);
  EXPECT_THROW(graphEdges({{1, 2}, {{1, 1, 1.0, 1, false}}}), std::invalid_argument);
  EXPECT_THROW(graphEdges({{1, 2}, {{1, 2, 1.0, 1, false}, {1, 2, 1.0, 1, false}}}),
               std::invalid_argument);
  EXPECT_THROW(graphEdges({{1, 2, 3}, {{1, 3, 1.0, 1, false}, {1, 2, 1.0, 1, false}}}),
               std::invalid_argument);
  const auto edges = graphEdges({{1, 5, 9}, {{1, 9, 0.5, 1, false}, {5, 9, 1.0, 1, false}}});
  ASSERT_EQ(edges.size(), 2u);
  EXPECT_EQ(edges[0].first, 0);
  EXPECT_EQ(edges[0].second, 2);
  EXPECT_EQ(edges[1].first, 1);
  EXPECT_DOUBLE_EQ(edges[1].weight, 1.0);
}

}  // namespace
}  // namespace active_matching_slam
