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
  double lasting_px2;  ///< more of it, to map and calibration
};

/// The gain of one update, by repeated linearisation (Bell & Cathey 1993), with the noise of what
/// linearisation leaves out; for map and calibration with that of errors that last. A measurement
/// that disagrees with all others is taken to have the noise with which it would not: matches are
/// more often far off than a Gaussian's. All errors count from the prior mean; the Jacobian of an
/// iteration is that of the mean reached. The second-order noise stays the prior's: shrunk along
/// with the posterior it trusted the wrong one of two explanations of a small first move, depths
/// reversed, for good.
class MeasurementUpdate {
 public:
  /// `X`: workspace, state size x 2 measurements. `calibration_share`: how much of its correction
  /// the calibration gets.
  MeasurementUpdate(const CameraModel& model, const CameraState& camera,
                    const std::vector<FeatureState>& features, const CovarianceMatrix& covariance,
                    std::vector<UsableMeasurement> measurements, double calibration_share,
                    Eigen::Ref<Eigen::MatrixXd> X);

  /// False when S could not be factorised or the result is not finite: nothing is to be fused.
  bool solve(int iterations);

  /// Makes P - X X^T the covariance after the measurement, but for the motion's rows and columns,
  /// and before the transport of the gauge. Returns what is to be taken off those too.
  Eigen::MatrixXd finish();

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
  void addNoise(Eigen::MatrixXd& S) const;
  bool doubtStrays(const Eigen::VectorXd& weighted, Eigen::MatrixXd& S);
  bool isLinearEnough(const Eigen::VectorXd& expected_pixels) const;

  const CameraModel& model_;
  const CameraState& prior_camera_;
  const std::vector<FeatureState>& prior_features_;
  const CovarianceMatrix& covariance_;
  std::vector<UsableMeasurement> measurements_;  ///< strays with the noise that they are given
  const double calibration_share_;
  Eigen::Ref<Eigen::MatrixXd> X_;  ///< P H^T, at the end P H^T U^-T, U U^T the lasting S

  CameraState camera_;
  std::vector<FeatureState> features_;
  MeasurementStack stack_;
  Eigen::VectorXd z_, delta_;
  Eigen::MatrixXd prior_gauge_, C_, L_, PL_;
  Eigen::LLT<Eigen::MatrixXd> llt_, lasting_llt_;  ///< of S, by the noise of one image and by all
  std::vector<double> noise_left_;
  std::vector<Eigen::Vector2d> left_px_;
  std::vector<Eigen::Matrix4d> moments_;  ///< relativeCovariance() of the prior; zero for points
  double nis_ = 0.0;
};

}  // namespace active_matching_slam
