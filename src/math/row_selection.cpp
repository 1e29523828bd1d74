#include "active_matching_slam/math/row_selection.h"

namespace active_matching_slam {

Eigen::MatrixXd selectBlock(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                            const std::vector<int>& rows, const std::vector<int>& columns) {
  Eigen::MatrixXd selected(static_cast<Eigen::Index>(rows.size()),
                           static_cast<Eigen::Index>(columns.size()));
  for (Eigen::Index k = 0; k < selected.cols(); ++k) {
    const int column = columns[static_cast<std::size_t>(k)];
    for (Eigen::Index i = 0; i < selected.rows(); ++i) {
      selected(i, k) = matrix(rows[static_cast<std::size_t>(i)], column);
    }
  }
  return selected;
}

Eigen::VectorXd selectRows(const Eigen::Ref<const Eigen::VectorXd>& vector,
                           const std::vector<int>& rows) {
  Eigen::VectorXd selected(static_cast<Eigen::Index>(rows.size()));
  for (Eigen::Index i = 0; i < selected.size(); ++i) {
    selected(i) = vector(rows[static_cast<std::size_t>(i)]);
  }
  return selected;
}

}  // namespace active_matching_slam
