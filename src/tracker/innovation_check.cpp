#include "active_matching_slam/tracker/innovation_check.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <numeric>

namespace active_matching_slam {

std::vector<int> agreeingMeasurements(const Eigen::VectorXd& innovation, const Eigen::MatrixXd& S,
                                      double chi2_threshold) {
  const int n = static_cast<int>(innovation.size()) / 2;
  if (n == 0) return {};
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  if (factor.info() != Eigen::Success || !factor.matrixLLT().allFinite()) return {};
  Eigen::MatrixXd L = factor.solve(Eigen::MatrixXd::Identity(2 * n, 2 * n));
  Eigen::VectorXd y = L * innovation;
  std::vector<int> kept(n);
  std::iota(kept.begin(), kept.end(), 0);
  while (!kept.empty()) {
    std::size_t worst = 0;
    double worst_chi2 = -1.0;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Eigen::Vector2d y_i = y.segment<2>(2 * kept[k]);
      const double chi2 = y_i.dot(L.block<2, 2>(2 * kept[k], 2 * kept[k]).inverse() * y_i);
      if (chi2 > worst_chi2) {
        worst_chi2 = chi2;
        worst = k;
      }
    }
    if (worst_chi2 <= chi2_threshold) break;
    // Marginalising a point out of S is a Schur complement in L, and leaves y of the rest as
    // y - L_:i L_ii^-1 y_i.
    const int i = kept[worst];
    const Eigen::Matrix2d inverse = L.block<2, 2>(2 * i, 2 * i).inverse();
    const Eigen::MatrixXd column = L.middleCols<2>(2 * i);
    y.noalias() -= column * (inverse * y.segment<2>(2 * i));
    L.noalias() -= column * inverse * column.transpose();
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return kept;
}

}  // namespace active_matching_slam
