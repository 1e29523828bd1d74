#include "active_matching_slam/matching/innovation_gate.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <numeric>
#include <utility>

#include "active_matching_slam/math/triangular.h"

namespace active_matching_slam {

std::vector<int> leaveOneOutInliers(const Eigen::VectorXd& innovation, const Eigen::MatrixXd& S,
                                    double chi2_threshold) {
  const int n = static_cast<int>(innovation.size()) / 2;
  if (n == 0) return {};
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  if (factor.info() != Eigen::Success || !factor.matrixLLT().allFinite()) return {};
  const Eigen::MatrixXd root = inverseRoot(factor);  // L = root^T root
  Eigen::VectorXd y = factor.solve(innovation);
  std::vector<Eigen::Matrix2d> blocks;  // L_ii
  for (int i = 0; i < n; ++i) blocks.push_back(inverseBlock(root, i));
  std::vector<int> kept(n);
  std::iota(kept.begin(), kept.end(), 0);
  // Marginalising a point out of S is a Schur complement in L, which becomes
  // L - L_:i L_ii^-1 L_i: and leaves y of the rest as y - L_:i L_ii^-1 y_i.
  struct Dropped {
    Eigen::MatrixXd column;   ///< L_:i, 2n x 2
    Eigen::Matrix2d inverse;  ///< L_ii^-1
  };
  std::vector<Dropped> dropped;
  while (!kept.empty()) {
    std::size_t worst = 0;
    double worst_chi2 = -1.0;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Eigen::Vector2d y_i = y.segment<2>(2 * kept[k]);
      const double chi2 = y_i.dot(blocks[kept[k]].inverse() * y_i);
      if (chi2 > worst_chi2) {
        worst_chi2 = chi2;
        worst = k;
      }
    }
    if (worst_chi2 <= chi2_threshold) break;
    const int i = kept[worst];
    Eigen::MatrixXd column =
        root.bottomRows(2 * (n - i)).transpose() * root.block(2 * i, 2 * i, 2 * (n - i), 2);
    for (const Dropped& d : dropped)
      column.noalias() -= d.column * (d.inverse * d.column.middleRows<2>(2 * i).transpose());
    const Eigen::Matrix2d inverse = blocks[i].inverse();
    y.noalias() -= column * (inverse * y.segment<2>(2 * i));
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
    for (const int k : kept)
      blocks[k] -= column.middleRows<2>(2 * k) * inverse * column.middleRows<2>(2 * k).transpose();
    dropped.push_back({std::move(column), inverse});
  }
  return kept;
}

}  // namespace active_matching_slam
