#include "active_matching_slam/information/separator.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "active_matching_slam/math/row_selection.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;

/// Points that hang together the more, the nearer they are in order, and two rows that all share.
MatrixXd chainOfPoints(int points, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  const int rows = 3 * points + 2, causes = points + 4;
  MatrixXd H(rows, causes);
  for (int k = 0; k < causes; ++k) {
    for (int i = 0; i < rows; ++i) {
      const double apart = i < 3 * points ? std::abs(i / 3 - k) : 0.0;
      H(i, k) = normal(generator) * std::exp(-0.5 * apart);
    }
  }
  MatrixXd P = H * H.transpose();
  P.diagonal().array() += 0.05;
  return P;
}

std::vector<int> rowsFrom(int begin, int end) {
  std::vector<int> rows(static_cast<std::size_t>(end - begin));
  std::iota(rows.begin(), rows.end(), begin);
  return rows;
}

std::vector<int> rowsOfPoints(const std::vector<int>& first_rows) {
  std::vector<int> rows;
  for (int first : first_rows) rows.insert(rows.end(), {first, first + 1, first + 2});
  return rows;
}

double log2Determinant(const MatrixXd& P, const std::vector<int>& rows) {
  return std::log2(selectBlock(P, rows, rows).determinant());
}

std::vector<int> both(std::vector<int> a, const std::vector<int>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// By entropies: |P_J|C| = |P_JC| / |P_C|.
double plainInformation(const MatrixXd& P, const std::vector<int>& J, const std::vector<int>& R,
                        const std::vector<int>& C) {
  return 0.5 * (log2Determinant(P, both(J, C)) + log2Determinant(P, both(R, C)) -
                log2Determinant(P, both(both(J, R), C)) - log2Determinant(P, C));
}

/// Twelve points, the first five inside; rows 36 and 37 are given, and of the last point no one may
/// make a separator.
SeparatorCandidates chainCandidates() {
  SeparatorCandidates candidates;
  for (int i = 0; i < 11; ++i) (i < 5 ? candidates.inside : candidates.outside).push_back(3 * i);
  candidates.others = {33, 34, 35};
  candidates.given = {36, 37};
  return candidates;
}

/// I(J; R | C) with these points chosen.
double leftAfter(const MatrixXd& P, const SeparatorCandidates& candidates,
                 const std::vector<int>& chosen) {
  const auto without = [&](const std::vector<int>& points) {
    std::vector<int> kept;
    for (int point : points) {
      if (std::count(chosen.begin(), chosen.end(), point) == 0) kept.push_back(point);
    }
    return rowsOfPoints(kept);
  };
  return plainInformation(P, without(candidates.inside),
                          both(without(candidates.outside), candidates.others),
                          both(candidates.given, rowsOfPoints(chosen)));
}

TEST(Separator, InformationIsADifferenceOfLogDeterminants) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const MatrixXd P = chainOfPoints(8, seed);
    const std::vector<int> J = rowsFrom(0, 9), R = both(rowsFrom(12, 20), rowsFrom(24, 26));
    const std::vector<int> C = both(rowsFrom(9, 12), rowsFrom(20, 24));
    EXPECT_NEAR(separatedInformation(P, J, R, C), plainInformation(P, J, R, C), 1e-9);
    EXPECT_NEAR(separatedInformation(P, R, J, C), plainInformation(P, J, R, C), 1e-9);
  }
  EXPECT_EQ(separatedInformation(MatrixXd::Identity(6, 6), {0, 1}, {2, 3}, {4}), 0.0);
}

TEST(Separator, EveryStepTakesThePointThatLeavesLeast) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const MatrixXd P = chainOfPoints(12, seed);
    const SeparatorCandidates candidates = chainCandidates();
    SeparatorLimits limits;
    limits.maximum_points = 6;
    limits.enough_bits = 0.0;
    const Separator separator = chooseSeparator(P, candidates, limits);
    ASSERT_GE(separator.points.size(), 4u);
    ASSERT_EQ(separator.bits.size(), separator.points.size() + 1);
    std::vector<int> chosen;
    for (std::size_t step = 0; step < separator.bits.size(); ++step) {
      EXPECT_NEAR(separator.bits[step], leftAfter(P, candidates, chosen), 1e-8);
      if (step == separator.points.size() || separator.bits[step] < 1e-6) break;
      double least = 1e9;
      int best = -1;
      for (int point : both(candidates.inside, candidates.outside)) {
        if (std::count(chosen.begin(), chosen.end(), point) > 0) continue;
        const double left = leftAfter(P, candidates, both(chosen, {point}));
        if (left < least) {
          least = left;
          best = point;
        }
      }
      EXPECT_EQ(separator.points[step], best) << "seed " << seed << ", step " << step;
      EXPECT_LE(separator.bits[step + 1], separator.bits[step]);
      chosen.push_back(separator.points[step]);
    }
  }
}

TEST(Separator, StopsWhenLittleIsLostAndTakesPresentOnesWhereThatCostsLittle) {
  const MatrixXd P = chainOfPoints(12, 7);
  SeparatorCandidates candidates = chainCandidates();
  SeparatorLimits limits;
  limits.enough_bits = 0.0;
  const Separator all = chooseSeparator(P, candidates, limits);
  limits.enough_bits = all.bits[3];
  EXPECT_EQ(chooseSeparator(P, candidates, limits).points.size(), 3u);

  limits.enough_bits = 0.0;
  for (int point : both(candidates.inside, candidates.outside)) {
    if (point == all.points[0]) continue;
    candidates.preferred = {point};
    const double more = leftAfter(P, candidates, {point}) - all.bits[1];
    limits.preference_bits = more + 1e-3;
    EXPECT_EQ(chooseSeparator(P, candidates, limits).points[0], point);
    limits.preference_bits = more - 1e-3;
    EXPECT_EQ(chooseSeparator(P, candidates, limits).points[0], all.points[0]);
  }
}

TEST(Separator, IsFoundWhereThereIsAMarkovBlanket) {
  // J is points 0 to 2, and all that they know of the others comes by points 3 and 4.
  const MatrixXd base = chainOfPoints(8, 3).bottomRightCorner(17, 17);  // 3 ... 7 and the last two
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  const MatrixXd F =
      MatrixXd::NullaryExpr(9, 8, [&]() { return 0.5 * normal(generator); });  // of 3, 4, the last
  const std::vector<int> blanket = both(rowsFrom(0, 6), {15, 16});
  MatrixXd P(26, 26);
  P.bottomRightCorner(17, 17) = base;
  P.topRightCorner(9, 17) = F * selectBlock(base, blanket, rowsFrom(0, 17));
  P.bottomLeftCorner(17, 9) = P.topRightCorner(9, 17).transpose();
  P.topLeftCorner(9, 9) = F * selectBlock(base, blanket, blanket) * F.transpose();
  P.topLeftCorner(9, 9).diagonal().array() += 1.0;
  SeparatorCandidates candidates;
  candidates.inside = {0, 3, 6};
  candidates.outside = {9, 12, 15, 18, 21};
  candidates.given = {24, 25};
  SeparatorLimits limits;
  limits.enough_bits = 1e-6;
  const Separator separator = chooseSeparator(P, candidates, limits);
  EXPECT_NEAR(separatedInformation(P, rowsFrom(0, 9), rowsFrom(15, 24),
                                   both(rowsFrom(9, 15), candidates.given)),
              0.0, 1e-9);
  EXPECT_EQ(separator.points.size(), 2u);
  EXPECT_NEAR(separator.bits.back(), 0.0, 1e-6);
}

TEST(Separator, StatesThatAreKnownExactlyDoNoHarm) {
  MatrixXd P = chainOfPoints(12, 2);
  P.row(36).setZero();
  P.col(36).setZero();
  P.row(34).setZero();
  P.col(34).setZero();
  const Separator separator = chooseSeparator(P, chainCandidates(), {});
  EXPECT_FALSE(separator.points.empty());
  for (double bits : separator.bits) EXPECT_TRUE(std::isfinite(bits));
}

TEST(ConservativeCut, IsNotLessThanWhatItReplacesInAnyDirection) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const MatrixXd P = chainOfPoints(10, seed);
    const std::vector<int> J = rowsFrom(0, 12), R = rowsFrom(15, 30);
    const std::vector<int> C = both(rowsFrom(12, 15), {30, 31});
    const GivenSeparator sides = givenSeparator(P, J, R, C);
    const ConservativeCut cut = conservativeCut(sides.inside, sides.outside, sides.across);
    MatrixXd before(27, 27), after = MatrixXd::Zero(27, 27);
    before << sides.inside, sides.across, sides.across.transpose(), sides.outside;
    after.topLeftCorner(12, 12) = sides.inside + cut.inside;
    after.bottomRightCorner(15, 15) = sides.outside + cut.outside;
    const MatrixXd more = after - before;
    const double scale = before.diagonal().maxCoeff();
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(more).eigenvalues().minCoeff(),
              -1e-9 * scale);
    // Simply dropping the link is another matter.
    MatrixXd dropped = MatrixXd::Zero(27, 27);
    dropped.topLeftCorner(12, 12) = sides.inside;
    dropped.bottomRightCorner(15, 15) = sides.outside;
    EXPECT_LT(Eigen::SelfAdjointEigenSolver<MatrixXd>(dropped - before).eigenvalues().minCoeff(),
              -1e-3 * scale);
  }
}

TEST(ConservativeCut, AddsTheCanonicalCorrelations) {
  const MatrixXd P = chainOfPoints(10, 4);
  const std::vector<int> J = rowsFrom(0, 12), R = rowsFrom(15, 30);
  const std::vector<int> C = both(rowsFrom(12, 15), {30, 31});
  const GivenSeparator sides = givenSeparator(P, J, R, C);
  const ConservativeCut cut = conservativeCut(sides.inside, sides.outside, sides.across);
  // In whitened coordinates of either side the eigenvalues of what is added are the correlations,
  // and bits are -1/2 sum log2(1 - rho^2).
  const auto correlations = [](const MatrixXd& covariance, const MatrixXd& added) {
    const MatrixXd L = covariance.llt().matrixL();
    const MatrixXd half = L.triangularView<Eigen::Lower>().solve(added);
    const MatrixXd whitened = L.triangularView<Eigen::Lower>().solve(half.transpose());
    return Eigen::VectorXd(Eigen::SelfAdjointEigenSolver<MatrixXd>(whitened).eigenvalues());
  };
  const Eigen::VectorXd inside = correlations(sides.inside, cut.inside);
  const Eigen::VectorXd outside = correlations(sides.outside, cut.outside);
  EXPECT_LT((outside.tail(12) - inside).norm(), 1e-9);
  EXPECT_LT(outside.head(3).norm(), 1e-9);
  const double bits = plainInformation(P, J, R, C);
  EXPECT_NEAR(-0.5 * (1.0 - inside.array().square()).log().sum() / std::log(2.0), bits, 1e-8);
  EXPECT_NEAR(explainedInformation(sides.inside, cut.explained), bits, 1e-8);
}

TEST(ConservativeCut, OfWhatIsIndependentAddsNothing) {
  const ConservativeCut cut =
      conservativeCut(MatrixXd::Identity(3, 3), MatrixXd::Identity(4, 4), MatrixXd::Zero(3, 4));
  EXPECT_TRUE(cut.inside.isZero(0.0));
  EXPECT_TRUE(cut.outside.isZero(0.0));
  EXPECT_EQ(explainedInformation(MatrixXd::Identity(3, 3), cut.explained), 0.0);
  EXPECT_EQ(conservativeCut(MatrixXd::Identity(3, 3), MatrixXd(0, 0), MatrixXd(3, 0)).inside.rows(),
            3);
}

}  // namespace
}  // namespace active_matching_slam
