#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {

/// A measurement that can be fused.
struct UsableMeasurement {
  int feature;  ///< index
  Eigen::Vector2d pixel;
  double variance_px2;    ///< R per axis, of this image alone
  double inflation;       ///< FeatureMeasurement::variance_inflation
  Eigen::Matrix2d shape;  ///< FeatureMeasurement::noise_shape

  /// What correlated errors add to R for all but the impulse: L.
  double correlatedVariance() const { return (inflation - 1.0) * variance_px2; }
};

/// By what impulses of unit covariance move the camera's motion (CameraError order).
using ImpulseRoot = Eigen::Matrix<double, CameraError::kMotionSize, 6>;

/// One EKF update, by repeated linearisation (IEKF; Bell & Cathey 1993), robust and adaptive in R:
/// - Second-order terms of the measurement function are noise of their own, by the prior's
///   covariance. (Shrunk along with the posterior they trusted the wrong one of two depth-reversed
///   hypotheses of a small first motion, for good.)
/// - Tails: errors are t-distributed; each measurement's R is weighed by its leave-one-out residual
///   (iteratively reweighted; Lange, Little & Taylor 1989).
/// - Scale: R of all is multiplied by the posterior mean of their common variance factor, inverse
///   gamma with the prior's degrees of freedom, from the leave-one-out residuals by variance
///   component estimation (Förstner 1979). An unexpected motion, which all measurements share, is
///   in the prediction from the others and does not count as noise.
/// - Correlation over time: map, calibration and past motion are corrected by R inflated, the
///   impulse since the last image, which is independent of the past, by R.
/// All errors count from the prior mean; the Jacobian of an iteration is that of the mean reached.
class RobustUpdate {
 public:
  /// `X`: workspace, state size x 2 measurements. `noise`: see Ekf::update().
  RobustUpdate(const CameraModel& model, const CameraState& camera,
               const std::vector<FeatureState>& features, const CovarianceMatrix& covariance,
               std::vector<UsableMeasurement> measurements, const NoisePrior& noise,
               const ImpulseRoot& impulse, Eigen::Ref<Eigen::MatrixXd> X);

  /// Corrected::kCamera. Before solve().
  void considerMap() { is_map_considered_ = true; }

  /// The first linearisation is made where the error state `start` leads to. Before solve().
  void startAt(const Eigen::VectorXd& start);

  /// False when S could not be factorised or the result is not finite: nothing is to be fused.
  bool solve(int iterations);

  /// Makes P - X X^T the covariance after the measurement, but for what is returned, which is to be
  /// added to that of the motion, and before the transport of the gauge.
  MotionCovariance finish();

  const CameraState& camera() const { return camera_; }
  const std::vector<FeatureState>& features() const { return features_; }
  double nis() const { return nis_; }
  /// UpdateReport::redundancy of each measurement, by the first linearisation; after solve().
  const std::vector<double>& redundancy() const { return redundancy_; }
  /// UpdateReport::residual_px of each, likewise.
  const std::vector<Eigen::Vector2d>& residualsPx() const { return residuals_px_; }
  /// UpdateReport::noise_scale and noise_degrees.
  double noiseScale() const { return noise_scale_; }
  double noiseDegrees() const { return noise_degrees_; }
  /// UpdateReport::linear and angular.
  const ImpulseEstimate& linearImpulse() const { return linear_impulse_; }
  const ImpulseEstimate& angularImpulse() const { return angular_impulse_; }
  const Eigen::MatrixXd& gaugeChange() const { return C_; }       ///< state size x kGaugeFreedoms
  const Eigen::MatrixXd& gaugeFunctionals() const { return L_; }  ///< likewise
  const Eigen::MatrixXd& gaugeCovariance() const { return PL_; }  ///< P L

 private:
  bool linearise();
  void moveTo(const Eigen::VectorXd& delta);
  bool step(bool first);
  void addNoise(Eigen::MatrixXd& S);
  bool estimateNoise(const Eigen::VectorXd& innovation, Eigen::MatrixXd& S);
  Eigen::Matrix<double, 6, Eigen::Dynamic> impulseGain(const Eigen::MatrixXd& B) const;
  void estimateImpulse(const Eigen::MatrixXd& B, const Eigen::VectorXd& innovation);
  bool reweigh(const Eigen::VectorXd& weighted, const std::vector<double>& expected_px2,
               double applied, Eigen::MatrixXd& S);
  double posteriorScale() const;
  bool isLinearEnough(const Eigen::VectorXd& expected_pixels) const;

  const CameraModel& model_;
  const CameraState& prior_camera_;
  const std::vector<FeatureState>& prior_features_;
  const CovarianceMatrix& covariance_;
  std::vector<UsableMeasurement> measurements_;  ///< with the noise that is found
  const NoisePrior noise_;
  const ImpulseRoot impulse_;
  Eigen::Ref<Eigen::MatrixXd> X_;  ///< gain times S, at the end gain times U, where U U^T = S

  CameraState camera_;
  std::vector<FeatureState> features_;
  MeasurementStack stack_;
  Eigen::VectorXd z_, delta_;
  Eigen::MatrixXd prior_gauge_, C_, L_, PL_;
  Eigen::LLT<Eigen::MatrixXd> llt_;                    ///< of S, in the end with R inflated
  MotionCovariance added_ = MotionCovariance::Zero();  ///< see finish()
  std::vector<Eigen::Matrix2d> second_order_;          ///< noise of each measurement [px^2]
  std::vector<double> redundancy_;
  std::vector<Eigen::Vector2d> residuals_px_;
  double noise_scale_ = 1.0, noise_degrees_ = 0.0;
  ImpulseEstimate linear_impulse_, angular_impulse_;
  bool is_map_considered_ = false;
  bool is_moved_ = false;                 ///< the mean to linearise about is not the prior's
  std::vector<Eigen::Matrix4d> moments_;  ///< relativeCovariance() of the prior; zero for points
  double nis_ = 0.0;
};

}  // namespace active_matching_slam
