#include "active_matching_slam/evaluation/consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "active_matching_slam/math/chi_square.h"

namespace active_matching_slam {

Eigen::Matrix<double, 6, 1> poseError(const Eigen::Isometry3d& T_world_camera_estimate,
                                      const Eigen::Isometry3d& T_world_camera_truth) {
  Eigen::Matrix<double, 6, 1> error;
  error.head<3>() = T_world_camera_truth.translation() - T_world_camera_estimate.translation();
  const Eigen::AngleAxisd rotation(Eigen::Matrix3d(T_world_camera_truth.linear() *
                                                   T_world_camera_estimate.linear().transpose()));
  error.tail<3>() = rotation.angle() * rotation.axis();
  return error;
}

std::optional<double> normalisedErrorSquared(const Eigen::VectorXd& error,
                                             const Eigen::MatrixXd& covariance) {
  if (error.size() == 0 || covariance.rows() != error.size() || covariance.cols() != error.size() ||
      !error.allFinite() || !covariance.allFinite())
    return std::nullopt;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  const double result = cholesky.matrixL().solve(error).squaredNorm();
  if (!std::isfinite(result)) return std::nullopt;
  return result;
}

std::optional<double> likeliestScale(const std::vector<Eigen::Isometry3d>& estimates,
                                     const std::vector<Eigen::Isometry3d>& truth,
                                     const std::vector<Eigen::Matrix<double, 6, 6>>& covariances) {
  // The error is d + u t, where d is that to a truth at the origin and t the true translation.
  double information = 0.0, weighted = 0.0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    Eigen::Isometry3d at_origin = truth[i];
    at_origin.translation().setZero();
    const Eigen::Matrix<double, 6, 1> d = poseError(estimates[i], at_origin);
    Eigen::Matrix<double, 6, 1> t = Eigen::Matrix<double, 6, 1>::Zero();
    t.head<3>() = truth[i].translation();
    const Eigen::LLT<Eigen::Matrix<double, 6, 6>> cholesky(covariances[i]);
    if (cholesky.info() != Eigen::Success) continue;
    const Eigen::Matrix<double, 6, 1> Wt = cholesky.solve(t);
    if (!Wt.allFinite() || !d.allFinite()) continue;
    information += t.dot(Wt);
    weighted -= d.dot(Wt);
  }
  const double scale = weighted / information;
  if (!(information > 0.0) || !(scale > 0.0)) return std::nullopt;
  return scale;
}

ChiSquareBounds chiSquareMeanBounds(int degrees, int runs, double confidence) {
  if (degrees < 1 || runs < 1)
    throw std::invalid_argument("chi-square bounds: degrees is " + std::to_string(degrees) +
                                " and runs is " + std::to_string(runs) + ", both must be positive");
  if (!(confidence > 0.0 && confidence < 1.0))
    throw std::invalid_argument("chi-square bounds: confidence is " + std::to_string(confidence) +
                                ", must lie in (0, 1)");
  const double tail = 0.5 * (1.0 - confidence);
  const double sum_degrees = static_cast<double>(degrees) * runs;
  return {chiSquareQuantile(sum_degrees, tail) / runs,
          chiSquareQuantile(sum_degrees, 1.0 - tail) / runs};
}

std::vector<double> meanOverRuns(const std::vector<std::vector<double>>& values_of_run) {
  std::size_t steps = 0;
  for (const std::vector<double>& values : values_of_run) steps = std::max(steps, values.size());
  std::vector<double> mean(steps, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t step = 0; step < steps; ++step) {
    double sum = 0.0;
    int count = 0;
    for (const std::vector<double>& values : values_of_run) {
      if (step >= values.size() || std::isnan(values[step])) continue;
      sum += values[step];
      ++count;
    }
    if (count > 0) mean[step] = sum / count;
  }
  return mean;
}

double fractionWithin(const std::vector<double>& values, const ChiSquareBounds& bounds) {
  int within = 0, count = 0;
  for (double value : values) {
    if (!std::isfinite(value)) continue;
    ++count;
    if (bounds.contains(value)) ++within;
  }
  return count > 0 ? static_cast<double>(within) / count : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace active_matching_slam
