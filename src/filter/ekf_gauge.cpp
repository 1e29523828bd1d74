#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/state_error.h"

namespace active_matching_slam {

void Ekf::fixScale(double relative_sigma) {
  if (features_.empty()) return;
  const Eigen::VectorXd functional = gaugeFunctionals(camera_, features_, covariance_).col(3);
  auto P = covariance_.view();
  const Eigen::VectorXd Pg = P * functional;
  const double variance = functional.dot(Pg) + relative_sigma * relative_sigma;
  if (!(variance > 0.0)) return;
  P.noalias() -= Pg * (Pg.transpose() / variance);
  P = 0.5 * (P + P.transpose()).eval();
}

}  // namespace active_matching_slam
