#include "active_matching_slam/math/triangular.h"

#include <algorithm>

namespace active_matching_slam {
namespace {

constexpr Eigen::Index kColumns = 32;  ///< taken at once

}  // namespace

Eigen::MatrixXd inverseRoot(const Eigen::LLT<Eigen::MatrixXd>& llt) {
  const Eigen::Index n = llt.rows();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index k = 0; k < n; k += kColumns) {
    auto columns = inverse.block(k, k, n - k, std::min(kColumns, n - k));
    llt.matrixLLT()
        .bottomRightCorner(n - k, n - k)
        .triangularView<Eigen::Lower>()
        .solveInPlace(columns);
  }
  return inverse;
}

Eigen::Matrix2d inverseBlock(const Eigen::MatrixXd& inverse_root, Eigen::Index i) {
  const auto columns = inverse_root.block(2 * i, 2 * i, inverse_root.rows() - 2 * i, 2);
  return columns.transpose() * columns;
}

void timesTransposeOf(const Eigen::MatrixXd& L, Eigen::Ref<Eigen::MatrixXd> X) {
  for (Eigen::Index end = L.rows(); end > 0;) {
    const Eigen::Index columns = std::min(kColumns, end), k = end - columns;
    X.middleCols(k, columns) = (X.leftCols(end) * L.block(k, 0, columns, end).transpose()).eval();
    end = k;
  }
}

}  // namespace active_matching_slam
