#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

namespace active_matching_slam {

/// Pose error in the order of CameraError: additive position of the world (3), then the world-frame
/// rotation vector r with R_truth = exp([r]x) R_estimate (3).
Eigen::Matrix<double, 6, 1> poseError(const Eigen::Isometry3d& T_world_camera_estimate,
                                      const Eigen::Isometry3d& T_world_camera_truth);

/// Normalised estimation error squared e^T P^-1 e (Bar-Shalom et al. 2001, eq. 5.4.2-1): chi-square
/// with as many degrees of freedom as `error` has rows when the filter is consistent. Empty when
/// `covariance` is not positive definite or anything is not finite.
std::optional<double> normalisedErrorSquared(const Eigen::VectorXd& error,
                                             const Eigen::MatrixXd& covariance);

/// Fixes the scale gauge of a map of free scale: the factor for the translations of `truth` that
/// minimises the sum of the normalised errors squared of `estimates`. Arguments
/// have equal sizes; all poses are from one world, the map's. Empty without a proper covariance or
/// when the truth never leaves the origin.
std::optional<double> likeliestScale(const std::vector<Eigen::Isometry3d>& estimates,
                                     const std::vector<Eigen::Isometry3d>& truth,
                                     const std::vector<Eigen::Matrix<double, 6, 6>>& covariances);

/// Two-sided bounds.
struct ChiSquareBounds {
  double lower = 0.0;
  double upper = 0.0;
  bool contains(double value) const { return lower <= value && value <= upper; }
};

/// Bounds of the *mean* over `runs` independent values of a chi-square variable with `degrees`
/// degrees of freedom. Throws std::invalid_argument unless both are positive and 0 < confidence
/// < 1.
ChiSquareBounds chiSquareMeanBounds(int degrees, int runs, double confidence = 0.95);

/// Mean over the runs at each step; NaN (no value at that step) is left out. Runs may differ in
/// length; a step that no run reached with a value is NaN.
std::vector<double> meanOverRuns(const std::vector<std::vector<double>>& values_of_run);

/// Fraction of the finite values within the bounds; NaN when there is none.
double fractionWithin(const std::vector<double>& values, const ChiSquareBounds& bounds);

}  // namespace active_matching_slam
