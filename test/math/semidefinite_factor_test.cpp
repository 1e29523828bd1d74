#include "active_matching_slam/math/semidefinite_factor.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <random>

namespace active_matching_slam {
namespace {

Eigen::MatrixXd randomRoot(int rows, int columns, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&]() { return normal(generator); });
}

TEST(SemidefiniteFactor, SolvesAsTheInverseDoes) {
  const Eigen::MatrixXd X = randomRoot(9, 12, 1), B = randomRoot(9, 4, 2);
  Eigen::MatrixXd P = X * X.transpose();
  P.row(3) *= 1e6;  // units far apart
  P.col(3) *= 1e6;
  const SemidefiniteFactor factor(P);
  EXPECT_EQ(factor.regularisation(), 0.0);
  EXPECT_EQ(factor.rows().size(), 9u);
  EXPECT_LT((P * factor.solve(B) - B).norm(), 1e-9 * B.norm());
  const Eigen::MatrixXd half = factor.halfSolve(B);
  EXPECT_LT((half.transpose() * half - B.transpose() * P.inverse() * B).norm(), 1e-9);
  EXPECT_LT((factor.root() * factor.root().transpose() - P).norm(), 1e-12 * P.norm());
  EXPECT_NEAR(factor.log2Determinant(), std::log2(P.determinant()), 1e-9);
}

TEST(SemidefiniteFactor, LeavesOutWhatIsKnownExactly) {
  const Eigen::MatrixXd X = randomRoot(5, 8, 3);
  const Eigen::MatrixXd small = X * X.transpose();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(6, 6);
  P.topLeftCorner(2, 2) = small.topLeftCorner(2, 2);
  P.topRightCorner(2, 3) = small.topRightCorner(2, 3);
  P.bottomLeftCorner(3, 2) = small.bottomLeftCorner(3, 2);
  P.bottomRightCorner(3, 3) = small.bottomRightCorner(3, 3);
  const SemidefiniteFactor factor(P);
  EXPECT_EQ(factor.rows(), (std::vector<int>{0, 1, 3, 4, 5}));
  EXPECT_NEAR(factor.log2Determinant(), std::log2(small.determinant()), 1e-9);
  EXPECT_TRUE(factor.solve(Eigen::MatrixXd::Ones(6, 1)).row(2).isZero(0.0));
  EXPECT_LT((factor.root() * factor.root().transpose() - P).norm(), 1e-12);
}

TEST(SemidefiniteFactor, TakesASingularCovarianceAndOneThatRoundingSpoiled) {
  const Eigen::MatrixXd X = randomRoot(8, 3, 4);
  const Eigen::MatrixXd P = X * X.transpose();
  const SemidefiniteFactor factor(P);
  EXPECT_LT(factor.regularisation(), 1e-10);
  EXPECT_TRUE(factor.solve(P).allFinite());
  EXPECT_LT((P * factor.solve(P) - P).norm(), 1e-6 * P.norm());

  Eigen::MatrixXd spoiled = Eigen::MatrixXd::Identity(2, 2);
  spoiled(0, 1) = spoiled(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(SemidefiniteFactor(spoiled).root().allFinite());
}

TEST(SemidefiniteFactor, OfNothingIsNothing) {
  const SemidefiniteFactor factor(Eigen::MatrixXd::Zero(3, 3));
  EXPECT_TRUE(factor.rows().empty());
  EXPECT_TRUE(factor.solve(Eigen::MatrixXd::Ones(3, 2)).isZero(0.0));
  EXPECT_EQ(factor.log2Determinant(), 0.0);
}

}  // namespace
}  // namespace active_matching_slam
