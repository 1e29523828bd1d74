#pragma once

#include <Eigen/Core>
#include <random>

namespace active_matching_slam {
namespace test {

/// Covariance of F image points that share `common` random causes, plus unit noise.
inline Eigen::MatrixXd randomMeasurementCovariance(int features, unsigned seed, int common = 8,
                                                   double spread_px = 10.0) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Eigen::MatrixXd H(2 * features, common);
  for (Eigen::Index k = 0; k < H.cols(); ++k) {
    for (Eigen::Index i = 0; i < H.rows(); ++i) H(i, k) = spread_px * normal(generator);
  }
  Eigen::VectorXd own(2 * features);
  for (Eigen::Index i = 0; i < own.size(); ++i) own(i) = 2.0 * normal(generator);
  Eigen::MatrixXd S = H * H.transpose();
  S.diagonal() += own.array().square().matrix();
  S.diagonal().array() += 1.0;
  return 0.5 * (S + S.transpose());
}

}  // namespace test
}  // namespace active_matching_slam
