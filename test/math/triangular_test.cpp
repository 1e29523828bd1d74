#include "active_matching_slam/math/triangular.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace active_matching_slam {
namespace {

/// Sizes about those of the blocks by which it goes.
const int kSizes[] = {1, 2, 31, 32, 33, 64, 100};

Eigen::MatrixXd positiveDefinite(int n) {
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(n, n);
  return A * A.transpose() + Eigen::MatrixXd::Identity(n, n);
}

TEST(Triangular, InverseRootsMakeTheInverse) {
  for (const int n : kSizes) {
    const Eigen::MatrixXd S = positiveDefinite(n);
    const Eigen::MatrixXd root = inverseRoot(Eigen::LLT<Eigen::MatrixXd>(S));
    EXPECT_TRUE(root.isLowerTriangular(0.0)) << n;
    EXPECT_LT((root.transpose() * root - S.inverse()).norm(), 1e-10) << n;
  }
}

TEST(Triangular, BlocksOfTheInverseAreThoseOfTheWhole) {
  const Eigen::MatrixXd S = positiveDefinite(64), inverse = S.inverse();
  const Eigen::MatrixXd root = inverseRoot(Eigen::LLT<Eigen::MatrixXd>(S));
  for (const int i : {0, 7, 31})
    EXPECT_LT((inverseBlock(root, i) - inverse.block<2, 2>(2 * i, 2 * i)).norm(), 1e-10) << i;
}

TEST(Triangular, MultipliesAsAPlainProductDoes) {
  for (const int n : kSizes) {
    const Eigen::MatrixXd L = Eigen::MatrixXd::Random(n, n).triangularView<Eigen::Lower>();
    Eigen::MatrixXd X = Eigen::MatrixXd::Random(7, n);
    const Eigen::MatrixXd product = X * L.transpose();
    timesTransposeOf(L, X);
    EXPECT_LT((X - product).norm(), 1e-12) << n;
  }
}

}  // namespace
}  // namespace active_matching_slam
