#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// These rows and columns of a matrix, in their order.
Eigen::MatrixXd selectBlock(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                            const std::vector<int>& rows, const std::vector<int>& columns);

/// These rows of a vector, in their order.
Eigen::VectorXd selectRows(const Eigen::Ref<const Eigen::VectorXd>& vector,
                           const std::vector<int>& rows);

}  // namespace active_matching_slam
