#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/state_error.h"
#include "filter/chi_square.h"

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

/// R of the measurements of an image as their innovations show it, written out plainly.
class PlainNoise {
 public:
  /// `own_px2`: R of the measurements, `second_order`: the noise besides, both block diagonal;
  /// `HPH`: covariance of the innovation without noise.
  PlainNoise(const Eigen::VectorXd& innovation, const Eigen::MatrixXd& HPH,
             const Eigen::MatrixXd& own_px2, const Eigen::MatrixXd& second_order,
             double prior_degrees)
      : y_(innovation),
        S_without_R_(HPH + second_order),
        prior_R_(own_px2),
        prior_degrees_(prior_degrees),
        weighed_R_(own_px2) {}

  /// One round of reweighing, from R of the round before.
  void iterate() {
    const Eigen::MatrixXd expected_R = applied_ * prior_R_, S = S_without_R_ + weighed_R_;
    Eigen::MatrixXd next_R = weighed_R_;
    double squares = 0.0, degrees = 0.0;
    far_off_ = 0;
    for (int i = 0; i < y_.size(); i += 2) {
      const Eigen::Matrix2d R = expected_R.block<2, 2>(i, i);
      Eigen::Vector2d residual;
      Eigen::Matrix2d C;
      leaveOneOut(i, S, &residual, &C);
      C += R - weighed_R_.block<2, 2>(i, i);
      const Eigen::Vector2d q = C.inverse() * residual;
      const double chi2 = residual.dot(q), weight = tails_.weight(chi2);
      squares += weight * q.dot(R * q);
      degrees += (R * C.inverse()).trace();
      next_R.block<2, 2>(i, i) = tails_.varianceFactor() / weight * R;
      far_off_ += chi2 > 9.0;
    }
    weighed_R_ = next_R;
    scale_ = applied_ * squares / (tails_.weightedSquare() * degrees);
    degrees_ = degrees;
    applied_ = std::isinf(prior_degrees_)
                   ? 1.0
                   : (prior_degrees_ + degrees * scale_) / (prior_degrees_ + degrees);
  }

  const Eigen::MatrixXd& R() const { return weighed_R_; }
  double scale() const { return scale_; }
  double degrees() const { return degrees_; }
  int farOff() const { return far_off_; }

 private:
  /// Measurement i predicted from all others by regression: its residual and the covariance of it.
  void leaveOneOut(int i, const Eigen::MatrixXd& S, Eigen::Vector2d* residual,
                   Eigen::Matrix2d* C) const {
    const int n = static_cast<int>(y_.size()), rest = n - 2;
    Eigen::VectorXi order(n);
    for (int k = 0; k < rest; ++k) order[k] = k < i ? k : k + 2;
    order.tail<2>() << i, i + 1;
    const Eigen::PermutationMatrix<Eigen::Dynamic> own_last(order);
    const Eigen::VectorXd y = own_last.transpose() * y_;
    const Eigen::MatrixXd ordered = own_last.transpose() * S * own_last;
    const Eigen::MatrixXd gain =
        ordered.bottomLeftCorner(2, rest) * ordered.topLeftCorner(rest, rest).inverse();
    *residual = y.tail<2>() - gain * y.head(rest);
    *C = ordered.bottomRightCorner<2, 2>() - gain * ordered.topRightCorner(rest, 2);
  }

  const TailModel tails_;
  Eigen::VectorXd y_;
  Eigen::MatrixXd S_without_R_, prior_R_;
  double prior_degrees_;
  Eigen::MatrixXd weighed_R_;
  double applied_ = 1.0, scale_ = 1.0, degrees_ = 0.0;
  int far_off_ = 0;
};

/// State after an update by measurements of noise `R` whose errors are correlated over time.
struct PlainPosterior {
  Eigen::VectorXd delta;
  Eigen::MatrixXd P;  ///< before the transport of the gauge

  /// What was known before the impulse of root `G` learns by R + `correlated`; the impulse, given
  /// that, by R.
  PlainPosterior(const Eigen::MatrixXd& prior, const Eigen::MatrixXd& H, const Eigen::MatrixXd& G,
                 const Eigen::MatrixXd& R, const Eigen::MatrixXd& correlated,
                 const Eigen::VectorXd& innovation) {
    const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(prior.rows(), prior.cols()), B = H * G;
    const Eigen::MatrixXd P_rest = prior - G * G.transpose();
    const Eigen::MatrixXd N = B * B.transpose() + R;
    const Eigen::MatrixXd K =
        P_rest * H.transpose() * (H * P_rest * H.transpose() + N + correlated).inverse();
    const Eigen::MatrixXd P_then =
        (I - K * H) * P_rest * (I - K * H).transpose() + K * (N + correlated) * K.transpose();
    const Eigen::MatrixXd GK = G * B.transpose() * N.inverse();
    const Eigen::VectorXd rest = K * innovation;
    delta = rest + GK * (innovation - H * rest);
    const Eigen::MatrixXd T = I - GK * H;
    P = T * P_then * T.transpose() + (G - GK * B) * (G - GK * B).transpose() +
        GK * R * GK.transpose();
  }
};

/// `posterior`'s covariance with the map's gauge carried over to the mean reached.
inline Eigen::MatrixXd transported(const Ekf& before, const PlainPosterior& posterior,
                                   const CameraState& camera,
                                   const std::vector<FeatureState>& features) {
  const int n = before.stateSize();
  CovarianceMatrix prior;
  prior.reset(n);
  prior.view() = before.covariance();
  const Eigen::MatrixXd L = gaugeFunctionals(before.camera(), before.features(), prior);
  const Eigen::MatrixXd M =
      Eigen::MatrixXd::Identity(n, n) + (gaugeGenerators(camera, features, n) -
                                         gaugeGenerators(before.camera(), before.features(), n)) *
                                            L.transpose();
  return M * posterior.P * M.transpose();
}

}  // namespace active_matching_slam
