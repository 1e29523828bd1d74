#pragma once

#include <vector>

#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// The features of a prior that are proper Gaussians, renumbered 0..size-1 in order. It refers to
/// the prior it was made from when all are proper, and owns a copy of the rest otherwise.
class ProperPrior {
 public:
  /// Leaves out features whose mean, marginal or column of S is not finite, or whose marginal is
  /// singular.
  explicit ProperPrior(const MeasurementPrior& prior);
  ProperPrior(const ProperPrior&) = delete;
  ProperPrior& operator=(const ProperPrior&) = delete;

  int size() const { return static_cast<int>(original_.size()); }
  int leftOut() const { return total_ - size(); }
  /// Index in the given prior.
  int original(int feature) const { return original_[static_cast<std::size_t>(feature)]; }
  const Eigen::VectorXd& z() const { return *z_; }
  const Eigen::MatrixXd& S() const { return *S_; }
  /// Of the prior's wide Gaussian, made anew; without rows when it has none.
  Eigen::MatrixXd wideS() const;
  /// Of R, by feature [px^2].
  Eigen::VectorXd noiseVariances() const;
  double wideProbability() const { return prior_.wide_probability; }
  Eigen::Vector2d mean(int feature) const { return z_->segment<2>(2 * feature); }
  Eigen::Matrix2d covariance(int feature) const {
    return S_->block<2, 2>(2 * feature, 2 * feature);
  }
  /// Leaves out features that the ones before determine exactly (S is singular).
  void leaveOutDependent();
  /// Leaves out one more (its index here).
  void leaveOut(int feature);

 private:
  void take(const std::vector<int>& kept);

  const MeasurementPrior& prior_;
  int total_;
  std::vector<int> original_;
  Eigen::VectorXd own_z_;
  Eigen::MatrixXd own_S_;
  const Eigen::VectorXd* z_;
  const Eigen::MatrixXd* S_;
};

}  // namespace active_matching_slam
