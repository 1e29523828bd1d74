#include "active_matching_slam/matching/false_alarm.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

namespace active_matching_slam {
namespace {

/// Predictions of n features that a camera of six freedoms moves by some pixels.
Eigen::MatrixXd jointCovariance(int n, unsigned seed, double motion_px = 8.0,
                                double noise_px = 0.5) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd J(2 * n, 6);
  for (int j = 0; j < J.cols(); ++j)
    for (int i = 0; i < J.rows(); ++i) J(i, j) = motion_px * normal(generator);
  return J * J.transpose() + noise_px * noise_px * Eigen::MatrixXd::Identity(2 * n, 2 * n);
}

std::vector<int> firstOnes(int k) {
  std::vector<int> ids(k);
  std::iota(ids.begin(), ids.end(), 0);
  return ids;
}

double binomial(int n, int k) {
  double result = 1.0;
  for (int i = 1; i <= k; ++i) result *= static_cast<double>(n - k + i) / i;
  return result;
}

TEST(LogFalseAlarms, IsTheProductOfTheChancesForEachChoice) {
  const int n = 9;
  const Eigen::MatrixXd S = jointCovariance(n, 1);
  const std::vector<int> matches = {1, 3, 0, 2, 1, 1, 4, 0, 2}, accepted = {0, 1, 3, 6, 8};
  const int k = static_cast<int>(accepted.size());
  double product = 1.0;
  for (const int i : accepted) {
    std::vector<int> rest;
    for (const int j : accepted)
      if (j != i) rest.push_back(j);
    Eigen::MatrixXd others(2 * (k - 1), 2 * (k - 1)), cross(2 * (k - 1), 2);
    for (int a = 0; a < k - 1; ++a) {
      cross.middleRows<2>(2 * a) = S.block<2, 2>(2 * rest[a], 2 * i);
      for (int b = 0; b < k - 1; ++b)
        others.block<2, 2>(2 * a, 2 * b) = S.block<2, 2>(2 * rest[a], 2 * rest[b]);
    }
    const Eigen::Matrix2d before = S.block<2, 2>(2 * i, 2 * i);
    const Eigen::Matrix2d after = before - cross.transpose() * others.inverse() * cross;
    const double fraction = std::sqrt(after.determinant() / before.determinant());
    product *= 1.0 - std::pow(1.0 - fraction, matches[i]);
  }
  const double expected =
      binomial(14, 3) * binomial(n - 3, k - 3) * std::pow(product, (k - 3.0) / k);
  EXPECT_NEAR(logFalseAlarms(S, matches, accepted), std::log10(expected), 1e-6);
}

TEST(LogFalseAlarms, OfThreeMatchesAndLessSayNothing) {
  const Eigen::MatrixXd S = jointCovariance(10, 2);
  for (int k = 0; k <= 3; ++k)
    EXPECT_EQ(logFalseAlarms(S, std::vector<int>(10, 1), firstOnes(k)),
              std::numeric_limits<double>::infinity());
}

TEST(LogFalseAlarms, OfACovarianceThatIsNoneSayNothing) {
  Eigen::MatrixXd S = jointCovariance(10, 3);
  S(4, 4) = std::nan("");
  EXPECT_EQ(logFalseAlarms(S, std::vector<int>(10, 1), firstOnes(8)),
            std::numeric_limits<double>::infinity());
  S = -jointCovariance(10, 3);
  EXPECT_EQ(logFalseAlarms(S, std::vector<int>(10, 1), firstOnes(8)),
            std::numeric_limits<double>::infinity());
}

TEST(LogFalseAlarms, FallWithEachFurtherMatchAndRiseWithTheMatchesMet) {
  const int n = 60;
  const Eigen::MatrixXd S = jointCovariance(n, 4);
  double before = std::numeric_limits<double>::infinity();
  for (int k = 10; k <= 50; k += 10) {
    const double alarms = logFalseAlarms(S, std::vector<int>(n, 1), firstOnes(k));
    EXPECT_LT(alarms, before);
    EXPECT_LT(alarms, logFalseAlarms(S, std::vector<int>(n, 5), firstOnes(k)));
    before = alarms;
  }
  EXPECT_LT(before, -10.0);
}

/// The largest set that grows from three of them and stays within 99 % of what the set predicts.
std::vector<int> largestConsensus(const Eigen::MatrixXd& S, const Eigen::MatrixXd& innovations,
                                  int starts, std::mt19937* generator) {
  const int n = static_cast<int>(S.rows()) / 2;
  std::vector<int> largest;
  for (int start = 0; start < starts; ++start) {
    std::vector<int> order = firstOnes(n), set;
    std::shuffle(order.begin(), order.end(), *generator);
    for (const int i : order) {
      if (set.size() < 3) {
        set.push_back(i);
        continue;
      }
      const int k = static_cast<int>(set.size());
      Eigen::MatrixXd others(2 * k, 2 * k), cross(2 * k, 2);
      Eigen::VectorXd y(2 * k);
      for (int a = 0; a < k; ++a) {
        y.segment<2>(2 * a) = innovations.col(set[a]);
        cross.middleRows<2>(2 * a) = S.block<2, 2>(2 * set[a], 2 * i);
        for (int b = 0; b < k; ++b)
          others.block<2, 2>(2 * a, 2 * b) = S.block<2, 2>(2 * set[a], 2 * set[b]);
      }
      const Eigen::LLT<Eigen::MatrixXd> factor(others);
      const Eigen::Vector2d residual = innovations.col(i) - cross.transpose() * factor.solve(y);
      const Eigen::Matrix2d left =
          S.block<2, 2>(2 * i, 2 * i) - cross.transpose() * factor.solve(cross);
      if (residual.dot(left.inverse() * residual) < 9.21) set.push_back(i);
    }
    if (set.size() > largest.size()) largest = set;
  }
  std::sort(largest.begin(), largest.end());
  return largest;
}

// What a blurred image does: every match is an accident, anywhere in its gate.
TEST(LogFalseAlarms, TellAccidentsFromTheCameraThatMoved) {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  const int n = 40;
  for (unsigned seed = 10; seed < 20; ++seed) {
    const Eigen::MatrixXd S = jointCovariance(n, seed);
    Eigen::MatrixXd innovations(2, n);
    for (int i = 0; i < n; ++i)
      for (int d = 0; d < 2; ++d)
        innovations(d, i) = std::sqrt(S(2 * i + d, 2 * i + d)) * normal(generator);
    const std::vector<int> accepted = largestConsensus(S, innovations, 200, &generator);
    EXPECT_GT(logFalseAlarms(S, std::vector<int>(n, 1), accepted), -1.0) << accepted.size();

    // A third of the features are true matches, the others accidental.
    Eigen::VectorXd drawn(2 * n);
    for (int i = 0; i < 2 * n; ++i) drawn[i] = normal(generator);
    const Eigen::MatrixXd root = Eigen::LLT<Eigen::MatrixXd>(S).matrixL();
    const Eigen::VectorXd truth = root * drawn;
    for (int i = 0; i < n / 3; ++i) innovations.col(i) = truth.segment<2>(2 * i);
    EXPECT_LT(logFalseAlarms(S, std::vector<int>(n, 1), firstOnes(n / 3)), -1.0);
  }
}

}  // namespace
}  // namespace active_matching_slam
