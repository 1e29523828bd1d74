#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/submaps/point_gaussian.h"

namespace active_matching_slam {

/// Points J given others C and the calibration: p(x_J | x_C) = N(mean + K (x_C - given_mean), Q).
/// What is measured of C or of the camera later does not change it: that is why a part of a map can
/// be laid aside in this form at no cost (compressed filter: Guivant & Nebot 2001).
struct Conditional {
  std::vector<FeatureId> ids;        ///< J
  Eigen::VectorXd mean;              ///< 3 |J| [m]
  std::vector<FeatureId> given_ids;  ///< C
  Eigen::VectorXd given_mean;        ///< the calibration, then 3 |C|
  Eigen::MatrixXd K;                 ///< 3 |J| x given_mean.size()
  Eigen::MatrixXd Q;                 ///< 3 |J| x 3 |J|

  int calibrationSize() const {
    return static_cast<int>(given_mean.size()) - 3 * static_cast<int>(given_ids.size());
  }

  /// Of points of `joint`, which may hold more: K = P_JC P_CC^-1, Q = P_JJ - K P_CJ. Throws
  /// std::invalid_argument for an id that `joint` has not or that is on both sides.
  static Conditional of(const PointGaussian& joint, const std::vector<FeatureId>& ids,
                        const std::vector<FeatureId>& given_ids);

  /// The mean where the given ones are as `joint`, which holds them all, has them.
  Eigen::VectorXd meanAt(const PointGaussian& joint) const;

  /// Appends J to `joint`, which holds all of C: P_J. = K P_C., P_JJ = K P_CC K^T + Q.
  void apply(PointGaussian& joint) const;

  /// K P_CC K^T + Q of any joint in which C has these rows, by the covariances K P_C. with all of
  /// it.
  Eigen::MatrixXd ownCovariance(const Eigen::Ref<const Eigen::MatrixXd>& cross,
                                const std::vector<int>& given_rows) const;

  /// All lengths times `factor` > 0.
  void rescale(double factor);
};

/// Some of J: the others are integrated out, which is to leave out their rows.
Conditional marginal(const Conditional& conditional, const std::vector<FeatureId>& ids);

}  // namespace active_matching_slam
