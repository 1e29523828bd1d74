#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace active_matching_slam {

/// L^-1, n x n, zero above the diagonal, where L L^T is what `llt` has factored: its inverse is
/// L^-T L^-1.
Eigen::MatrixXd inverseRoot(const Eigen::LLT<Eigen::MatrixXd>& llt);

/// The 2 x 2 block on the diagonal of the inverse, in rows 2i and 2i + 1, by its inverseRoot().
Eigen::Matrix2d inverseBlock(const Eigen::MatrixXd& inverse_root, Eigen::Index i);

/// X <- X L^T for a lower triangular L, n x n, and X with n columns: by matrix products, which are
/// faster than to solve with L^-1.
void timesTransposeOf(const Eigen::MatrixXd& L, Eigen::Ref<Eigen::MatrixXd> X);

}  // namespace active_matching_slam
