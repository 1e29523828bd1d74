#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "active_matching_slam/math/feature_id.h"

namespace active_matching_slam {

/// Detection rates of a feature's search (Chli 2009, section 5.3.3).
struct FeatureRates {
  double true_positive = 0.9;    ///< Ptp: probability of a match where the feature is, in (0, 1)
  double false_positive = 1e-4;  ///< Pfp: probability of a spurious match per pixel, in (0, 1)
};

/// All that a matcher knows of the filter: the joint Gaussian prediction of the image points of the
/// F features that should be visible. (Chli 2009, eq. 3.13)
struct MeasurementPrior {
  std::vector<FeatureId> ids;       ///< F
  Eigen::VectorXd z;                ///< 2F: u0 v0 u1 v1 ... [px]
  Eigen::MatrixXd S;                ///< 2F x 2F, measurement noise included [px^2]
  double noise_variance_px2 = 1.0;  ///< R = noise_variance_px2 * I, already inside S
  /// F, where each feature has its own noise: R_i = noise_variances_px2[i] * I. Else empty.
  std::vector<double> noise_variances_px2;
  std::vector<FeatureRates> rates;  ///< F, or empty for the defaults of the options
  /// The prior may be a mixture: with this probability the covariance is `wide_S` (2F x 2F, of the
  /// same mean, at least S), as when the camera jerks. Matchers of one Gaussian take S.
  double wide_probability = 0.0;
  Eigen::MatrixXd wide_S;

  int size() const { return static_cast<int>(ids.size()); }
  double noiseVariance_px2(int feature) const {
    return noise_variances_px2.empty() ? noise_variance_px2
                                       : noise_variances_px2[static_cast<std::size_t>(feature)];
  }
  auto mean(int feature) const { return z.segment<2>(2 * feature); }
  auto covariance(int feature) const { return S.block<2, 2>(2 * feature, 2 * feature); }
};

}  // namespace active_matching_slam
