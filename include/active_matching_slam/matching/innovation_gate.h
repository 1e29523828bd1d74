#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// Leave-one-out chi-square gate (Baarda's data snooping) of n matched points. `innovation`: 2n,
/// `S`: 2n x 2n innovation covariance. With L = S^-1 and y = L * innovation, the residual of point
/// i against its prediction from all others is L_ii^-1 y_i with covariance L_ii^-1, so y_i^T
/// L_ii^-1 y_i is chi-square with 2 degrees of freedom: one factorisation tests every point. The
/// worst point above `chi2_threshold` is removed and the test repeated until all pass. Returns the
/// indices of the inliers, ascending. Empty when S is not positive definite.
std::vector<int> leaveOneOutInliers(const Eigen::VectorXd& innovation, const Eigen::MatrixXd& S,
                                    double chi2_threshold);

}  // namespace active_matching_slam
