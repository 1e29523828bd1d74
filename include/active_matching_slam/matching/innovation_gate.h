#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// Which of n matched points agree with all the others. `innovation`: 2n, `S`: 2n x 2n covariance.
/// With L = S^-1 and y = L * innovation, what the others predict of point i is missed by
/// L_ii^-1 y_i with covariance L_ii^-1, so y_i^T L_ii^-1 y_i is chi-square with 2 degrees of
/// freedom: one factorisation tests every point against the rest. The worst point over
/// `chi2_threshold` is dropped and the others are tested again, until all agree.
/// Returns the indices kept, ascending. Empty when S is not positive definite.
std::vector<int> agreeingMeasurements(const Eigen::VectorXd& innovation, const Eigen::MatrixXd& S,
                                      double chi2_threshold);

}  // namespace active_matching_slam
