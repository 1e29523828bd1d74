#include "active_matching_slam/matching/innovation_gate.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <random>

namespace active_matching_slam {
namespace {

constexpr double kThreshold = 13.8;

/// Innovations as a camera makes them: a few causes in common, and noise of each point.
struct Innovations {
  Eigen::MatrixXd S;
  Eigen::VectorXd values;
};

Innovations makeInnovations(int n, int seed, int common_causes = 12) {
  std::mt19937 generator(static_cast<unsigned>(seed));
  std::normal_distribution<double> normal;
  const auto draw = [&](int rows, int columns) {
    Eigen::MatrixXd m(rows, columns);
    for (int j = 0; j < columns; ++j)
      for (int i = 0; i < rows; ++i) m(i, j) = normal(generator);
    return m;
  };
  const Eigen::MatrixXd J = 3.0 * draw(2 * n, common_causes);
  Innovations result;
  result.S = J * J.transpose() + 0.5 * Eigen::MatrixXd::Identity(2 * n, 2 * n);
  result.values = J * draw(common_causes, 1) + std::sqrt(0.5) * draw(2 * n, 1);
  return result;
}

/// How far point i is from what the others in `all` predict of it, by conditioning one by one.
double chi2OfOne(const Innovations& x, const std::vector<int>& all, int i) {
  std::vector<int> rest;
  std::copy_if(all.begin(), all.end(), std::back_inserter(rest), [&](int k) { return k != i; });
  const int m = static_cast<int>(rest.size());
  Eigen::MatrixXd B(2 * m, 2 * m), C(2, 2 * m);
  Eigen::VectorXd v(2 * m);
  for (int a = 0; a < m; ++a) {
    v.segment<2>(2 * a) = x.values.segment<2>(2 * rest[a]);
    C.middleCols<2>(2 * a) = x.S.block<2, 2>(2 * i, 2 * rest[a]);
    for (int b = 0; b < m; ++b)
      B.block<2, 2>(2 * a, 2 * b) = x.S.block<2, 2>(2 * rest[a], 2 * rest[b]);
  }
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = x.S.block<2, 2>(2 * i, 2 * i);
  if (m > 0) {
    const Eigen::MatrixXd gain = B.ldlt().solve(C.transpose()).transpose();
    mean = gain * v;
    covariance -= gain * C.transpose();
  }
  const Eigen::Vector2d residual = x.values.segment<2>(2 * i) - mean;
  return residual.dot(covariance.inverse() * residual);
}

/// The same rule, the plain way.
std::vector<int> agreeingOneByOne(const Innovations& x, double threshold) {
  std::vector<int> kept(x.values.size() / 2);
  std::iota(kept.begin(), kept.end(), 0);
  while (!kept.empty()) {
    std::vector<double> chi2;
    for (int i : kept) chi2.push_back(chi2OfOne(x, kept, i));
    const auto worst = std::max_element(chi2.begin(), chi2.end());
    if (*worst <= threshold) break;
    kept.erase(kept.begin() + (worst - chi2.begin()));
  }
  return kept;
}

TEST(InnovationCheck, AgreesWithConditioningEachPointOnAllOthers) {
  for (int seed = 0; seed < 30; ++seed) {
    Innovations x = makeInnovations(3 + seed, seed);
    for (int i = 0; i < 2 * (seed % 5); i += 2) x.values(i) += 4.0 + seed;
    EXPECT_EQ(leaveOneOutInliers(x.values, x.S, kThreshold), agreeingOneByOne(x, kThreshold))
        << "seed " << seed;
    // A low threshold drops many, one after the other.
    EXPECT_EQ(leaveOneOutInliers(x.values, x.S, 2.0), agreeingOneByOne(x, 2.0)) << "seed " << seed;
  }
}

TEST(InnovationCheck, KeepsNearlyAllThatAgree) {
  int kept = 0;
  for (int seed = 0; seed < 50; ++seed) {
    const Innovations x = makeInnovations(40, seed);
    kept += static_cast<int>(leaveOneOutInliers(x.values, x.S, kThreshold).size());
  }
  // 99.9 % of them by the threshold, 2000 drawn: 2 +- 1.4 are dropped.
  EXPECT_GE(kept, 2000 - 8);
}

TEST(InnovationCheck, FindsOnePercentToThirtyPercentOfOutliers) {
  for (const int outliers : {1, 5, 10, 20, 30}) {
    Innovations x = makeInnovations(100, outliers);
    std::mt19937 generator(static_cast<unsigned>(outliers));
    std::uniform_real_distribution<double> angle(0.0, 2.0 * M_PI), size(12.0, 40.0);
    std::vector<int> order(100);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), generator);
    for (int k = 0; k < outliers; ++k) {
      const double a = angle(generator), s = size(generator);
      x.values.segment<2>(2 * order[k]) += s * Eigen::Vector2d(std::cos(a), std::sin(a));
    }
    const std::vector<int> kept = leaveOneOutInliers(x.values, x.S, kThreshold);
    for (int k = 0; k < outliers; ++k)
      EXPECT_FALSE(std::binary_search(kept.begin(), kept.end(), order[k]))
          << "of " << outliers << " outliers, that at " << order[k];
    EXPECT_GE(static_cast<int>(kept.size()), 100 - outliers - 2) << outliers << " outliers";
  }
}

TEST(InnovationCheck, AnswersInAscendingOrder) {
  Innovations x = makeInnovations(30, 3);
  x.values(10) += 50.0;
  const std::vector<int> kept = leaveOneOutInliers(x.values, x.S, kThreshold);
  EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
  EXPECT_EQ(kept.size(), 29u);
}

TEST(InnovationCheck, OfNothingKeepsNothing) {
  EXPECT_TRUE(leaveOneOutInliers(Eigen::VectorXd(), Eigen::MatrixXd(), kThreshold).empty());
}

TEST(InnovationCheck, AsksOfASinglePointOnlyItsOwnCovariance) {
  const Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
  EXPECT_EQ(leaveOneOutInliers(Eigen::Vector2d(3.0, 2.0), S, kThreshold), std::vector<int>{0});
  EXPECT_TRUE(leaveOneOutInliers(Eigen::Vector2d(3.0, 3.0), S, kThreshold).empty());
}

TEST(InnovationCheck, KeepsNothingWhereTheCovarianceIsNotPositive) {
  const Eigen::VectorXd innovation = Eigen::VectorXd::Zero(4);
  Eigen::MatrixXd S = Eigen::MatrixXd::Ones(4, 4);  // singular
  EXPECT_TRUE(leaveOneOutInliers(innovation, S, kThreshold).empty());
  S = -Eigen::MatrixXd::Identity(4, 4);
  EXPECT_TRUE(leaveOneOutInliers(innovation, S, kThreshold).empty());
  S = Eigen::MatrixXd::Constant(4, 4, std::nan(""));
  EXPECT_TRUE(leaveOneOutInliers(innovation, S, kThreshold).empty());
}

}  // namespace
}  // namespace active_matching_slam
