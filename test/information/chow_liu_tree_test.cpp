#include "active_matching_slam/information/chow_liu_tree.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "active_matching_slam/information/gaussian_information.h"
#include "information/random_gaussian.h"
#include "information/vectors.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using test::randomMeasurementCovariance;

TEST(ChowLiuTree, IsTheMaximumSpanningTreeOfThePairwiseInformation) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const MatrixXd S = randomMeasurementCovariance(1 + seed, seed);
    const ChowLiuTree tree = chowLiuTree(S);
    const auto expected = maximumSpanningForest(pairInformationMatrix(S));
    ASSERT_EQ(tree.edges.size(), expected.size());
    ASSERT_EQ(tree.size(), static_cast<int>(1 + seed));
    for (std::size_t e = 0; e < expected.size(); ++e) {
      EXPECT_EQ(tree.edges[e].first, expected[e].first);
      EXPECT_EQ(tree.edges[e].second, expected[e].second);
      EXPECT_DOUBLE_EQ(tree.edges[e].weight, expected[e].weight);
      EXPECT_EQ(tree.cross_covariances[e],
                (S.block<2, 2>(2 * expected[e].first, 2 * expected[e].second)));
    }
  }
}

TEST(ChowLiuTree, PrecisionIsThatOfTheTreesCovariance) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const MatrixXd S = randomMeasurementCovariance(1 + seed, seed);
    const ChowLiuTree tree = chowLiuTree(S);
    const MatrixXd precision = treeCovariance(tree).inverse();
    const auto blocks = treePrecision(tree);
    for (int i = 0; i < tree.size(); ++i) {
      const Eigen::Matrix2d expected = precision.block<2, 2>(2 * i, 2 * i);
      EXPECT_LE((blocks[i] - expected).norm(), 1e-9 * expected.norm());
    }
  }
}

TEST(ChowLiuTree, InformationIsThatOfTheTreesCovariance) {
  const MatrixXd S = randomMeasurementCovariance(25, 77);
  const ChowLiuTree tree = chowLiuTree(S);
  const FeatureInformation expected = featureInformation(treeCovariance(tree));
  const Eigen::VectorXd bits = treeInformationBits(tree);
  for (int i = 0; i < tree.size(); ++i) {
    EXPECT_NEAR(bits(i), expected.bits(i), 1e-9 * expected.bits(i));
  }
}

TEST(ChowLiuTree, DivergenceIsThePlainFormulaAndLeastOfAllTrees) {
  const int features = 5;
  const MatrixXd S = randomMeasurementCovariance(features, 12);
  const ChowLiuTree best = chowLiuTree(S);
  const auto plain = [&](const MatrixXd& tree) {
    const double trace = (tree.inverse() * S).trace() - 2 * features;
    return 0.5 *
           (trace / std::log(2.0) + std::log2(tree.determinant()) - std::log2(S.determinant()));
  };
  const double lost = *treeDivergenceBits(S, best);
  EXPECT_NEAR(lost, plain(treeCovariance(best)), 1e-9 * std::max(1.0, lost));
  // All 125 labelled trees on 5 nodes, by their Pruefer sequences.
  for (int code = 0; code < 125; ++code) {
    std::vector<int> sequence = {code % 5, code / 5 % 5, code / 25}, degree(features, 1);
    for (int node : sequence) ++degree[node];
    std::vector<WeightedEdge> edges;
    const auto join = [&](int a, int b) { edges.push_back({std::min(a, b), std::max(a, b), 1.0}); };
    for (int node : sequence) {
      int leaf = 0;
      while (degree[leaf] != 1) ++leaf;
      join(leaf, node);
      --degree[leaf];
      --degree[node];
    }
    std::vector<int> last;
    for (int node = 0; node < features; ++node) {
      if (degree[node] == 1) last.push_back(node);
    }
    join(last[0], last[1]);
    const ChowLiuTree other = treeOf(S, edges);
    EXPECT_NEAR(*treeDivergenceBits(S, other), plain(treeCovariance(other)), 1e-8);
    EXPECT_GE(*treeDivergenceBits(S, other), lost - 1e-9);
  }
}

TEST(ChowLiuTree, OfAMarkovChainLosesNothing) {
  const int features = 6;
  MatrixXd S(2 * features, 2 * features);
  for (int i = 0; i < features; ++i) {
    for (int k = 0; k < features; ++k) {
      S.block<2, 2>(2 * i, 2 * k) = std::pow(0.8, std::abs(i - k)) * Eigen::Matrix2d::Identity();
    }
  }
  const ChowLiuTree tree = chowLiuTree(S);
  EXPECT_NEAR(*treeDivergenceBits(S, tree), 0.0, 1e-9);
  EXPECT_LE((treeCovariance(tree) - S).norm(), 1e-12);
}

TEST(ChowLiuTree, IndependentGroupsStayApart) {
  MatrixXd S = MatrixXd::Zero(10, 10);
  S.topLeftCorner(4, 4) = randomMeasurementCovariance(2, 1);
  S.bottomRightCorner(6, 6) = randomMeasurementCovariance(3, 2);
  const ChowLiuTree tree = chowLiuTree(S);
  EXPECT_EQ(tree.edges.size(), 3u);
  const auto blocks = treePrecision(tree);
  const MatrixXd precision = treeCovariance(tree).inverse();
  for (int i = 0; i < 5; ++i) {
    EXPECT_LE((blocks[i] - precision.block<2, 2>(2 * i, 2 * i)).norm(), 1e-12);
  }
}

TEST(ChowLiuTree, DegenerateInputHasADefinedResult) {
  EXPECT_EQ(chowLiuTree(MatrixXd(0, 0)).size(), 0);
  EXPECT_TRUE(chowLiuTree(MatrixXd::Identity(8, 8)).edges.empty());

  MatrixXd S = randomMeasurementCovariance(3, 4);
  S(2, 2) = std::numeric_limits<double>::quiet_NaN();
  const ChowLiuTree tree = chowLiuTree(S);
  ASSERT_EQ(tree.edges.size(), 1u);
  EXPECT_EQ(tree.edges[0].first, 0);
  EXPECT_EQ(tree.edges[0].second, 2);
  EXPECT_TRUE(treePrecision(tree)[1].isZero(0.0));
  EXPECT_DOUBLE_EQ(treeInformationBits(tree)(1), 0.0);
  EXPECT_FALSE(treeDivergenceBits(S, tree).has_value());

  const MatrixXd one = randomMeasurementCovariance(1, 6);
  MatrixXd twins(4, 4);
  twins << one, one, one, one;
  const ChowLiuTree twin_tree = chowLiuTree(twins);
  ASSERT_EQ(twin_tree.edges.size(), 1u);
  EXPECT_TRUE(treePrecision(twin_tree)[0].allFinite());
  EXPECT_GT(treeInformationBits(twin_tree)(0), 20.0);

  EXPECT_THROW(chowLiuTree(MatrixXd::Identity(3, 3)), std::invalid_argument);
  EXPECT_THROW(treeOf(twins, {{0, 2, 1.0}}), std::invalid_argument);
}

TEST(ChowLiuTree, AgreesWithTheGoldenVectors) {
  const std::vector<std::string> files = test::vectorFiles();
  if (files.empty()) GTEST_SKIP() << "no vectors beside AMS_DATA";
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const nlohmann::json vector = test::readJson(file);
    const MatrixXd S = test::matrixOf(vector["input"]["S"]);
    const nlohmann::json& mi = vector["mi"];
    const ChowLiuTree tree = chowLiuTree(S);
    ASSERT_EQ(tree.edges.size(), mi["tree_edges"].size());
    for (std::size_t e = 0; e < tree.edges.size(); ++e) {
      EXPECT_EQ(tree.edges[e].first, mi["tree_edges"][e][0].get<int>());
      EXPECT_EQ(tree.edges[e].second, mi["tree_edges"][e][1].get<int>());
    }
    const Eigen::VectorXd bits = treeInformationBits(tree);
    for (int i = 0; i < tree.size(); ++i)
      EXPECT_NEAR(bits(i), mi["tree_mi"][i].get<double>(), 1e-9);
    EXPECT_NEAR(*treeDivergenceBits(S, tree), mi["tree_kl_bits"].get<double>(), 1e-9);
  }
}

}  // namespace
}  // namespace active_matching_slam
