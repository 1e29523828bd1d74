#pragma once

#include <Eigen/LU>
#include <utility>

namespace active_matching_slam {
namespace test {

/// What a filter's steps do to states S that are not touched, by accumulators (compressed filter:
/// Guivant & Nebot 2001): exact whatever the steps are. Of the touched state x: x <- F x and a
/// measurement with gain K:
///   Phi <- F Phi, (I - K H) Phi;  Psi += Phi^T H^T S^-1 H Phi;  theta += Phi^T H^T S^-1 nu,
///   P_Sx = P_Sx(0) Phi^T,  P_SS = P_SS(0) - P_Sx(0) Psi P_xS(0),  x_S = x_S(0) + P_Sx(0) theta.
class CompressedFilter {
 public:
  CompressedFilter(Eigen::VectorXd mean_S, Eigen::MatrixXd P_SS, Eigen::MatrixXd P_Sx)
      : mean_(std::move(mean_S)), P_SS_(std::move(P_SS)), P_Sx_(std::move(P_Sx)) {
    const Eigen::Index n = P_Sx_.cols();
    Phi_ = Eigen::MatrixXd::Identity(n, n);
    Psi_ = Eigen::MatrixXd::Zero(n, n);
    theta_ = Eigen::VectorXd::Zero(n);
  }

  /// x <- F x, with noise or without.
  void move(const Eigen::MatrixXd& F) { Phi_ = F * Phi_; }
  /// Before the filter's update: P is that of x.
  void measure(const Eigen::MatrixXd& P, const Eigen::MatrixXd& H, const Eigen::VectorXd& nu,
               const Eigen::MatrixXd& R) {
    const Eigen::MatrixXd S_inverse = (H * P * H.transpose() + R).inverse();
    const Eigen::MatrixXd HPhi = H * Phi_;
    theta_ += HPhi.transpose() * S_inverse * nu;
    Psi_ += HPhi.transpose() * S_inverse * HPhi;
    Phi_ -= P * H.transpose() * S_inverse * HPhi;
  }

  Eigen::VectorXd mean() const { return mean_ + P_Sx_ * theta_; }
  Eigen::MatrixXd covariance() const { return P_SS_ - P_Sx_ * Psi_ * P_Sx_.transpose(); }
  Eigen::MatrixXd crossCovariance() const { return P_Sx_ * Phi_.transpose(); }

 private:
  Eigen::VectorXd mean_;
  Eigen::MatrixXd P_SS_, P_Sx_, Phi_, Psi_;
  Eigen::VectorXd theta_;
};

}  // namespace test
}  // namespace active_matching_slam
