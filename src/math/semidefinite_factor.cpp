#include "active_matching_slam/math/semidefinite_factor.h"

#include <cmath>

#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {

using Eigen::Index;
using Eigen::MatrixXd;

SemidefiniteFactor::SemidefiniteFactor(const Eigen::Ref<const MatrixXd>& covariance)
    : size_(covariance.rows()) {
  for (Index i = 0; i < size_; ++i) {
    const double variance = covariance(i, i);
    if (std::isfinite(variance) && variance > 0.0) rows_.push_back(static_cast<int>(i));
  }
  const Index n = static_cast<Index>(rows_.size());
  scale_.resize(n);
  for (Index i = 0; i < n; ++i) scale_(i) = std::sqrt(covariance(rows_[slot(i)], rows_[slot(i)]));
  MatrixXd correlation(n, n);
  for (Index k = 0; k < n; ++k) {
    if (n == size_) {  // the same, in vector code
      correlation.col(k).tail(n - k) =
          covariance.col(k).tail(n - k).array() / (scale_.tail(n - k).array() * scale_(k));
      continue;
    }
    for (Index i = k; i < n; ++i) {
      correlation(i, k) = covariance(rows_[slot(i)], rows_[slot(k)]) / (scale_(i) * scale_(k));
    }
  }
  // Derivation: rounding of a factorisation of some hundred rows of variance 1 is below 1e-13.
  constexpr double kFirstRegularisation = 1e-13;
  llt_.compute(correlation);
  const auto failed = [this]() {
    return llt_.info() != Eigen::Success || !llt_.matrixLLT().diagonal().allFinite();
  };
  while (n > 0 && failed()) {
    regularisation_ = regularisation_ == 0.0 ? kFirstRegularisation : 10.0 * regularisation_;
    if (regularisation_ < 1.0) {
      correlation.diagonal().setConstant(1.0 + regularisation_);
    } else {
      correlation.setIdentity();  // no covariance at all
    }
    llt_.compute(correlation);
  }
}

MatrixXd SemidefiniteFactor::halfSolve(const Eigen::Ref<const MatrixXd>& B) const {
  const Index n = static_cast<Index>(rows_.size());
  MatrixXd half(n, B.cols());
  for (Index k = 0; k < B.cols(); ++k) {
    if (n == size_) {
      half.col(k) = B.col(k).cwiseQuotient(scale_);
      continue;
    }
    for (Index i = 0; i < n; ++i) half(i, k) = B(rows_[slot(i)], k) / scale_(i);
  }
  if (n > 0) llt_.matrixL().solveInPlace(half);
  return half;
}

MatrixXd SemidefiniteFactor::solve(const Eigen::Ref<const MatrixXd>& B) const {
  MatrixXd half = halfSolve(B);
  MatrixXd solution = MatrixXd::Zero(size_, B.cols());
  if (half.rows() == 0) return solution;
  llt_.matrixU().solveInPlace(half);
  for (Index i = 0; i < half.rows(); ++i) solution.row(rows_[slot(i)]) = half.row(i) / scale_(i);
  return solution;
}

MatrixXd SemidefiniteFactor::root() const {
  const Index n = static_cast<Index>(rows_.size());
  MatrixXd result = MatrixXd::Zero(size_, n);
  if (n == 0) return result;
  const MatrixXd L = llt_.matrixL();
  for (Index i = 0; i < n; ++i) result.row(rows_[slot(i)]) = scale_(i) * L.row(i);
  return result;
}

double SemidefiniteFactor::log2Determinant() const {
  double sum = scale_.array().log().sum();
  if (scale_.size() > 0) sum += llt_.matrixLLT().diagonal().array().log().sum();
  return 2.0 * sum / std::log(2.0);
}

}  // namespace active_matching_slam
