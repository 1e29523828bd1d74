#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {

/// A measurement that can be fused.
struct UsableMeasurement {
  int feature;  ///< index
  Eigen::Vector2d pixel;
  double variance_px2;
  double lasting_px2;     ///< more of it, to all but the impulse
  Eigen::Matrix2d shape;  ///< of both: FeatureMeasurement::noise_shape
};

/// By what impulses of unit covariance move the camera's motion (CameraError order).
using ImpulseRoot = Eigen::Matrix<double, CameraError::kMotionSize, 6>;

/// The gain of one update, by repeated linearisation (Bell & Cathey 1993), with the noise of what
/// linearisation leaves out and of errors that last; the impulse since the image before, once the
/// rest is known so, with the noise of one image. All of an image's matches are noisier, or less
/// noisy, when they disagree more or less than expected on the whole. Matches are more often far
/// off than a Gaussian's: each has the variance that an error of the t distribution which is as
/// large as what it and all others disagree by is weighed with (Lange, Little & Taylor 1989). All
/// errors count from the prior mean; the Jacobian of an iteration is that of the mean reached. The
/// second-order noise stays the prior's: shrunk along with the posterior it trusted the wrong one
/// of two explanations of a small first move, depths reversed, for good.
class MeasurementUpdate {
 public:
  /// `X`: workspace, state size x 2 measurements. `calibration_share`: how much of its correction
  /// the calibration gets.
  MeasurementUpdate(const CameraModel& model, const CameraState& camera,
                    const std::vector<FeatureState>& features, const CovarianceMatrix& covariance,
                    std::vector<UsableMeasurement> measurements, double calibration_share,
                    const ImpulseRoot& impulse, Eigen::Ref<Eigen::MatrixXd> X);

  /// False when S could not be factorised or the result is not finite: nothing is to be fused.
  bool solve(int iterations);

  /// Makes P - X X^T the covariance after the measurement, but for what is returned, which is to be
  /// added to that of the motion, and before the transport of the gauge.
  MotionCovariance finish();

  const CameraState& camera() const { return camera_; }
  const std::vector<FeatureState>& features() const { return features_; }
  double nis() const { return nis_; }
  /// UpdateReport::noise_left of each measurement, by the first linearisation; after solve().
  const std::vector<double>& noiseLeft() const { return noise_left_; }
  /// UpdateReport::left_px of each, likewise.
  const std::vector<Eigen::Vector2d>& leftPx() const { return left_px_; }
  const Eigen::MatrixXd& gaugeChange() const { return C_; }       ///< state size x kGaugeFreedoms
  const Eigen::MatrixXd& gaugeFunctionals() const { return L_; }  ///< likewise
  const Eigen::MatrixXd& gaugeCovariance() const { return PL_; }  ///< P L

 private:
  bool linearise();
  bool step(bool first);
  void addNoise(Eigen::MatrixXd& S);
  void scaleNoise(Eigen::MatrixXd& S);
  bool judgeNoise(const Eigen::VectorXd& innovation, Eigen::MatrixXd& S);
  Eigen::Matrix<double, 6, Eigen::Dynamic> impulseGain(const Eigen::MatrixXd& B) const;
  bool weighTails(const Eigen::VectorXd& weighted, const std::vector<double>& variances_px2,
                  Eigen::MatrixXd& S);
  bool isLinearEnough(const Eigen::VectorXd& expected_pixels) const;

  const CameraModel& model_;
  const CameraState& prior_camera_;
  const std::vector<FeatureState>& prior_features_;
  const CovarianceMatrix& covariance_;
  std::vector<UsableMeasurement> measurements_;  ///< with the noise that is found
  const double calibration_share_;
  const ImpulseRoot impulse_;
  Eigen::Ref<Eigen::MatrixXd> X_;  ///< gain times S, at the end gain times U, where U U^T = S

  CameraState camera_;
  std::vector<FeatureState> features_;
  MeasurementStack stack_;
  Eigen::VectorXd z_, delta_;
  Eigen::MatrixXd prior_gauge_, C_, L_, PL_;
  Eigen::LLT<Eigen::MatrixXd> llt_;                    ///< of S, in the end with errors that last
  MotionCovariance added_ = MotionCovariance::Zero();  ///< see finish()
  std::vector<Eigen::Matrix2d> second_order_;          ///< noise of each measurement [px^2]
  std::vector<double> noise_left_;
  std::vector<Eigen::Vector2d> left_px_;
  std::vector<Eigen::Matrix4d> moments_;  ///< relativeCovariance() of the prior; zero for points
  double nis_ = 0.0;
};

}  // namespace active_matching_slam
