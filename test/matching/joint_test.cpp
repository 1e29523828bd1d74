#include "../../src/matching/joint.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "active_matching_slam/evaluation/simulated_problem.h"
#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"

namespace active_matching_slam {
namespace {

Eigen::MatrixXd covarianceOf(int features, std::uint64_t seed) {
  SimulatedProblemOptions options;
  options.features = features;
  return ProblemSimulator(options, seed).next().prior.S;
}

/// Rows and columns of some features.
Eigen::MatrixXd block(const Eigen::MatrixXd& S, const std::vector<int>& rows,
                      const std::vector<int>& columns) {
  Eigen::MatrixXd result(2 * rows.size(), 2 * columns.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < columns.size(); ++j)
      result.block<2, 2>(2 * static_cast<int>(i), 2 * static_cast<int>(j)) =
          S.block<2, 2>(2 * rows[i], 2 * columns[j]);
  return result;
}

/// Measures features one by one, each time in two ways from the same start, and compares marginals,
/// information and the moves of the means with the plain formulas on the whole covariance.
void expectPlainConditionals(const Joint& joint, const Eigen::MatrixXd& S) {
  const int size = joint.size();
  std::vector<int> measured;
  auto given = joint.prior();
  for (int c = 0; c + 1 < size; c += 2) {
    joint.measure(given, (c + 1) % size);  // a branch with a common past
    const auto next = joint.measure(given, c);
    EXPECT_EQ(next, joint.measure(given, c)) << "siblings have one covariance";
    const Eigen::MatrixXd S_mm = block(S, measured, measured);
    const auto conditional = [&](const std::vector<int>& a, const std::vector<int>& b) {
      Eigen::MatrixXd result = block(S, a, b);
      if (!measured.empty())
        result -= block(S, a, measured) * S_mm.llt().solve(block(S, measured, b));
      return result;
    };
    const Eigen::MatrixXd precision = conditional({c}, {c}).inverse();
    EXPECT_LT((precision - next->measuredPrecision()).norm(), 1e-9 * precision.norm());
    for (std::size_t i = 0; i < next->touched().size(); ++i) {
      const Eigen::MatrixXd cross = conditional({next->touched()[i]}, {c});
      EXPECT_LT((cross - next->cross(i)).norm(), 1e-9 * S.norm());
    }
    measured.push_back(c);
    const Eigen::MatrixXd S_after = block(S, measured, measured);
    std::vector<int> left;
    for (int f = 0; f < size; ++f)
      if (!next->isMeasured(f)) left.push_back(f);
    const Eigen::MatrixXd S_left =
        block(S, left, left) -
        block(S, left, measured) * S_after.llt().solve(block(S, measured, left));
    for (std::size_t i = 0; i < left.size(); ++i) {
      const Marginal& marginal = next->marginal(left[i]);
      const Eigen::Matrix2d plain =
          S_left.block<2, 2>(2 * static_cast<int>(i), 2 * static_cast<int>(i));
      EXPECT_LT((plain - marginal.covariance).norm(), 1e-9 * plain.norm());
      if (left.size() < 2) continue;
      std::vector<int> part = {2 * static_cast<int>(i), 2 * static_cast<int>(i) + 1};
      EXPECT_NEAR(*partitionInformationBits(S_left, part), marginal.information_bits, 1e-8)
          << "the information of the prior's precision holds for every conditional";
    }
    given = next;
  }
}

TEST(DenseJoint, ConditionsAsThePlainFormulas) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Eigen::MatrixXd S = covarianceOf(12, seed);
    expectPlainConditionals(*makeDenseJoint(S, featureInformation(S).precision_determinant,
                                            Eigen::VectorXd::Ones(S.rows() / 2)),
                            S);
  }
}

TEST(TreeJoint, ConditionsAsThePlainFormulasOnTheTreesCovariance) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const ChowLiuTree tree = chowLiuTree(covarianceOf(12, seed));
    expectPlainConditionals(*makeTreeJoint(tree, Eigen::VectorXd::Ones(tree.size())),
                            treeCovariance(tree));
  }
}

TEST(TreeJoint, TouchesOnlyTheSubtreeOfTheMeasurement) {
  // A chain 0 - 1 - 2 - 3: measuring 1 parts 0 from the rest.
  const Eigen::MatrixXd S = covarianceOf(4, 4);
  const ChowLiuTree chain = treeOf(S, {{0, 1, 1.0}, {1, 2, 1.0}, {2, 3, 1.0}});
  const auto joint = makeTreeJoint(chain, Eigen::VectorXd::Ones(chain.size()));
  const auto one = joint->measure(joint->prior(), 1);
  EXPECT_EQ(3u, one->touched().size());
  EXPECT_EQ(std::vector<int>{}, joint->measure(one, 0)->touched());
  EXPECT_EQ(std::vector<int>{3}, joint->measure(one, 2)->touched());
}

TEST(DenseJoint, AMeasuredFeatureIsKnownToItsOwnNoise) {
  const Eigen::MatrixXd S = covarianceOf(3, 5);
  const Eigen::Vector3d noise_variances(0.3, 2.0, 7.0);
  const auto dense =
      makeDenseJoint(S, featureInformation(S).precision_determinant, noise_variances);
  const auto tree = makeTreeJoint(chowLiuTree(S), noise_variances);
  for (const Joint* joint : {dense.get(), tree.get()})
    for (int f = 0; f < 3; ++f)
      EXPECT_EQ(joint->measure(joint->prior(), f)->marginal(f).covariance,
                noise_variances[f] * Eigen::Matrix2d::Identity());
}

}  // namespace
}  // namespace active_matching_slam
