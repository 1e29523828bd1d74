#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// Cholesky factor of a covariance that may be singular: P = L L^T on the rows that have a variance
/// (a state that is known exactly has none, and nothing depends on it), each scaled to variance 1
/// and with the least regularisation that lets it be factored.
class SemidefiniteFactor {
 public:
  /// Reads the lower triangle. Rows that are not finite count as without variance.
  explicit SemidefiniteFactor(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

  /// Rows with a variance, ascending; the others are left out of all that follows.
  const std::vector<int>& rows() const { return rows_; }
  /// Added to each variance, relative to it: 0 where P is positive definite, else the first of
  /// 1e-13, 1e-12, ... that makes it so.
  double regularisation() const { return regularisation_; }

  /// L^-1 B, of rows().size() rows: B^T P^-1 B is its square.
  Eigen::MatrixXd halfSolve(const Eigen::Ref<const Eigen::MatrixXd>& B) const;
  /// P^-1 B, 0 in rows without variance.
  Eigen::MatrixXd solve(const Eigen::Ref<const Eigen::MatrixXd>& B) const;
  /// L, with zero rows where there is no variance: P.rows() x rows().size().
  Eigen::MatrixXd root() const;
  /// log2 |P| of rows().
  double log2Determinant() const;

 private:
  Eigen::Index size_ = 0;
  std::vector<int> rows_;
  Eigen::VectorXd scale_;  ///< standard deviations of rows_
  Eigen::LLT<Eigen::MatrixXd> llt_;
  double regularisation_ = 0.0;
};

}  // namespace active_matching_slam
