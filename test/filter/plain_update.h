#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {

/// Through the lens of the filter's estimate.
inline std::optional<FeatureProjection> projectIn(const Ekf& filter, const CameraModel& model,
                                                  const FeatureState& feature) {
  return projectFeature(model.corrected(filter.camera().lens), filter.camera(), feature);
}

/// H written out in full.
inline Eigen::MatrixXd denseJacobian(const Ekf& filter, const CameraModel& model,
                                     const std::vector<FeatureId>& ids) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * ids.size(), filter.stateSize());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState& feature = *filter.find(ids[i]);
    const auto projection = projectIn(filter, model, feature);
    H.block<2, CameraError::kSize>(2 * i, 0) = projection->d_camera;
    H.block(2 * i, feature.offset, 2, feature.size()) =
        projection->d_feature.leftCols(feature.size());
  }
  return H;
}

/// Noise by the second-order terms of the measurement function, block diagonal.
inline Eigen::MatrixXd denseSecondOrderNoise(const Ekf& filter, const CameraModel& model,
                                             const std::vector<FeatureId>& ids) {
  CovarianceMatrix P;
  P.reset(filter.stateSize());
  P.view() = filter.covariance();
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(2 * ids.size(), 2 * ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState& feature = *filter.find(ids[i]);
    if (feature.kind != FeatureKind::kInverseDepth) continue;
    N.block<2, 2>(2 * i, 2 * i) =
        secondOrderNoise(*projectIn(filter, model, feature), relativeCovariance(feature, P));
  }
  return N;
}

/// By what impulses of unit covariance move the error state, from what predict() adds for them.
inline Eigen::MatrixXd impulseRoot(const Ekf& before, double interval_s) {
  Ekf moved = before, nearly_free = before;
  FilterOptions options = before.options();
  const double little = 1e-3;
  const Eigen::Vector2d sigmas(options.sigma_acceleration_mps2,
                               options.sigma_angular_acceleration_rps2);
  options.sigma_acceleration_mps2 = options.sigma_angular_acceleration_rps2 = little;
  nearly_free.setOptions(options);
  moved.predict(interval_s);
  nearly_free.predict(interval_s);
  const Eigen::MatrixXd added = moved.covariance() - nearly_free.covariance();
  Eigen::MatrixXd G(added.rows(), 6);  // an impulse is what the velocity gains
  G << added.middleCols<3>(CameraError::kVelocity),
      added.middleCols<3>(CameraError::kAngularVelocity);
  for (int k = 0; k < 2; ++k) {
    const double variance = (sigmas[k] * sigmas[k] - little * little) * interval_s * interval_s;
    G.middleCols<3>(3 * k) *= sigmas[k] * interval_s / variance;
  }
  return G;
}

inline double relativeDifference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() / b.norm();
}

}  // namespace active_matching_slam
