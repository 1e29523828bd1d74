#include "active_matching_slam/information/separator.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/semidefinite_factor.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using MatrixRef = Eigen::Ref<const MatrixXd>;

std::vector<int> joined(std::vector<int> first, const std::vector<int>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// cov(rows | given).
MatrixXd conditionalCovariance(const MatrixRef& P, const std::vector<int>& rows,
                               const std::vector<int>& given) {
  MatrixXd covariance = selectBlock(P, rows, rows);
  if (given.empty()) return covariance;
  const SemidefiniteFactor factor(selectBlock(P, given, given));
  const MatrixXd half = factor.halfSolve(selectBlock(P, given, rows));
  covariance.noalias() -= half.transpose() * half;
  return covariance;
}

std::vector<int> rowsOfPoints(const std::vector<int>& points) {
  std::vector<int> rows;
  for (int first : points) rows.insert(rows.end(), {first, first + 1, first + 2});
  return rows;
}

/// A covariance less a square, H^T H, that is conditioned on one point after the other: of it only
/// the points' own blocks and the columns asked for are ever computed.
class PivotedCholesky {
 public:
  /// Refers to `base` and `H`. The first `points` points may be conditioned on, in `steps` steps.
  PivotedCholesky(const MatrixXd& base, const MatrixXd& H, int points, int steps)
      : base_(base), H_(H), W_(MatrixXd::Zero(base.rows(), 3 * steps)) {
    for (int i = 0; i < points; ++i) {
      blocks_.push_back(base.block<3, 3>(3 * i, 3 * i) -
                        H.middleCols(3 * i, 3).transpose() * H.middleCols(3 * i, 3));
    }
  }

  const Eigen::Matrix3d& block(int point) const { return blocks_[slot(point)]; }

  void conditionOn(int point) {
    MatrixXd column = base_.middleCols(3 * point, 3);
    column.noalias() -= H_.transpose() * H_.middleCols(3 * point, 3);
    column.noalias() -= W_.leftCols(used_) * W_.block(3 * point, 0, 3, used_).transpose();
    const Eigen::LLT<Eigen::Matrix3d> llt(block(point));
    llt.matrixL().transpose().solveInPlace<Eigen::OnTheRight>(column);
    W_.middleCols(used_, 3) = column;
    used_ += 3;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      const auto own = column.middleRows(static_cast<Index>(3 * i), 3);
      blocks_[i].noalias() -= own * own.transpose();
    }
  }

 private:
  const MatrixXd &base_, &H_;
  MatrixXd W_;
  Index used_ = 0;
  std::vector<Eigen::Matrix3d> blocks_;
};

/// 1/2 log2(|before| / |after|) [bit]; 0 where either is singular.
double gainBits(const Eigen::Matrix3d& before, const Eigen::Matrix3d& after) {
  const Eigen::LLT<Eigen::Matrix3d> first(before), second(after);
  if (first.info() != Eigen::Success || second.info() != Eigen::Success) return 0.0;
  const double bits = (first.matrixLLT().diagonal().array().log().sum() -
                       second.matrixLLT().diagonal().array().log().sum()) /
                      std::log(2.0);
  return std::isfinite(bits) ? std::max(0.0, bits) : 0.0;
}

}  // namespace

GivenSeparator givenSeparator(const MatrixRef& P, const std::vector<int>& J,
                              const std::vector<int>& R, const std::vector<int>& C) {
  const MatrixXd both = conditionalCovariance(P, joined(J, R), C);
  const Index inside = static_cast<Index>(J.size()), outside = static_cast<Index>(R.size());
  return {both.topLeftCorner(inside, inside), both.bottomRightCorner(outside, outside),
          both.topRightCorner(inside, outside)};
}

double separatedInformation(const MatrixRef& P, const std::vector<int>& J,
                            const std::vector<int>& R, const std::vector<int>& C) {
  const GivenSeparator sides = givenSeparator(P, J, R, C);
  const MatrixXd half = SemidefiniteFactor(sides.outside).halfSolve(sides.across.transpose());
  return explainedInformation(sides.inside, half.transpose() * half);
}

Separator chooseSeparator(const MatrixRef& P, const SeparatorCandidates& candidates,
                          const SeparatorLimits& limits) {
  const std::vector<int> points = joined(candidates.inside, candidates.outside);
  const int inside_count = static_cast<int>(candidates.inside.size());
  const int point_count = static_cast<int>(points.size());
  const MatrixXd both =
      conditionalCovariance(P, joined(rowsOfPoints(points), candidates.others), candidates.given);
  const Index nJ = 3 * inside_count, nR = both.rows() - nJ;
  const MatrixXd J = both.topLeftCorner(nJ, nJ), R = both.bottomRightCorner(nR, nR);
  const MatrixXd across = both.topRightCorner(nJ, nR);
  const MatrixXd told_of_R = SemidefiniteFactor(J).halfSolve(across);
  const MatrixXd told_of_J = SemidefiniteFactor(R).halfSolve(across.transpose());

  Separator separator;
  separator.bits.push_back(explainedInformation(J, told_of_J.transpose() * told_of_J));
  const int steps = std::min(limits.maximum_points, point_count);
  const MatrixXd nothing(0, both.cols());
  PivotedCholesky given_none(both, nothing, point_count, steps);
  PivotedCholesky given_R(J, told_of_J, inside_count, steps);
  PivotedCholesky given_J(R, told_of_R, point_count - inside_count, steps);

  std::vector<char> preferred(slot(point_count), 0), free(slot(point_count), 1);
  for (int i = 0; i < point_count; ++i) {
    preferred[slot(i)] =
        std::count(candidates.preferred.begin(), candidates.preferred.end(), points[slot(i)]) > 0;
  }
  while (static_cast<int>(separator.points.size()) < steps &&
         separator.bits.back() > limits.enough_bits) {
    int best = -1, best_preferred = -1;
    std::vector<double> gain(slot(point_count), 0.0);
    for (int i = 0; i < point_count; ++i) {
      if (!free[slot(i)]) continue;
      gain[slot(i)] =
          gainBits(given_none.block(i),
                   i < inside_count ? given_R.block(i) : given_J.block(i - inside_count));
      if (best < 0 || gain[slot(i)] > gain[slot(best)]) best = i;
      if (preferred[slot(i)] &&
          (best_preferred < 0 || gain[slot(i)] > gain[slot(best_preferred)])) {
        best_preferred = i;
      }
    }
    if (best < 0 || !(gain[slot(best)] > 0.0)) break;
    if (best_preferred >= 0 && gain[slot(best_preferred)] > 0.0 &&
        gain[slot(best_preferred)] >= gain[slot(best)] - limits.preference_bits) {
      best = best_preferred;
    }
    free[slot(best)] = 0;
    separator.points.push_back(points[slot(best)]);
    separator.bits.push_back(std::max(0.0, separator.bits.back() - gain[slot(best)]));
    given_none.conditionOn(best);
    if (best < inside_count) {
      given_R.conditionOn(best);
    } else {
      given_J.conditionOn(best - inside_count);
    }
  }
  return separator;
}

ConservativeCut conservativeCut(const MatrixRef& A, const MatrixRef& D, const MatrixRef& X) {
  ConservativeCut cut;
  cut.inside = MatrixXd::Zero(A.rows(), A.cols());
  cut.outside = MatrixXd::Zero(D.rows(), D.cols());
  cut.explained = cut.inside;
  if (A.rows() == 0 || D.rows() == 0) return cut;
  const SemidefiniteFactor inside(A), outside(D);
  // W = L_A^-1 X L_D^-T, by its transpose.
  const MatrixXd Wt = outside.halfSolve(inside.halfSolve(X).transpose());
  const MatrixXd L_A = inside.root(), L_D = outside.root();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(Wt.transpose() * Wt);
  const MatrixXd& U = eigen.eigenvectors();
  // For any orthonormal U, W = sum u_k (W^T u_k)^T: with rho_k the length of W^T u_k each term is
  // covered, whatever the rounding of U.
  const MatrixXd told = Wt * U;
  const Eigen::VectorXd rho = told.colwise().norm();
  const Eigen::VectorXd root = rho.cwiseSqrt();
  const MatrixXd left = L_A * (U * root.asDiagonal());
  const Eigen::VectorXd inverse_root =
      (rho.array() > 0.0).select(root.array().max(1e-300).inverse(), 0.0);
  const MatrixXd right = L_D * (told * inverse_root.asDiagonal());
  const MatrixXd known = L_A * Wt.transpose();
  cut.inside.noalias() = left * left.transpose();
  cut.outside.noalias() = right * right.transpose();
  cut.explained.noalias() = known * known.transpose();
  return cut;
}

double explainedInformation(const MatrixRef& A, const MatrixRef& explained) {
  return std::max(0.0, 0.5 * (SemidefiniteFactor(A).log2Determinant() -
                              SemidefiniteFactor(A - explained).log2Determinant()));
}

}  // namespace active_matching_slam
