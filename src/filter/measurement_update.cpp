#include "measurement_update.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/triangular.h"

namespace active_matching_slam {
namespace {

constexpr int kMotion = CameraError::kMotionSize;
/// Linearisation is repeated when it missed by more than this, root mean square, in sigmas.
constexpr double kNonlinearityTolerance = 0.2;
/// Of the t distribution of what matches are off by: degrees of freedom, and the variance in that
/// of Gaussian noise for which the covariance is right if the noise is Gaussian after all.
constexpr double kTailDegrees = 4.0, kTailVariance = 1.18;
constexpr double kTailTolerance = 0.02;  ///< of the variances
constexpr int kMostTailRounds = 4;
/// Degrees of freedom for which the noise common to an image's matches is taken to be as expected,
/// and the innovation's square, for each of its own, that says that it is. (By NEES over rendered
/// runs.)
constexpr double kDegreesLikeExpected = 80.0, kExpectedInnovation = 0.85;

}  // namespace

MeasurementUpdate::MeasurementUpdate(const CameraModel& model, const CameraState& camera,
                                     const std::vector<FeatureState>& features,
                                     const CovarianceMatrix& covariance,
                                     std::vector<UsableMeasurement> measurements,
                                     double calibration_share, const ImpulseRoot& impulse,
                                     Eigen::Ref<Eigen::MatrixXd> X)
    : model_(model),
      prior_camera_(camera),
      prior_features_(features),
      covariance_(covariance),
      measurements_(std::move(measurements)),
      calibration_share_(calibration_share),
      impulse_(impulse),
      X_(X),
      camera_(camera),
      features_(features) {
  const int n = covariance.size();
  z_.resize(2 * measurements_.size());
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    z_.segment<2>(2 * i) = measurements_[i].pixel;
    const FeatureState& feature = features[measurements_[i].feature];
    moments_.push_back(feature.kind == FeatureKind::kInverseDepth
                           ? relativeCovariance(feature, covariance)
                           : Eigen::Matrix4d(Eigen::Matrix4d::Zero()));
  }
  delta_ = Eigen::VectorXd::Zero(n);
  prior_gauge_ = gaugeGenerators(camera, features, n);
  C_ = Eigen::MatrixXd::Zero(n, kGaugeFreedoms);
  L_ = active_matching_slam::gaugeFunctionals(camera, features, covariance);
  // L reads the rotation off the camera alone: what P makes of that are columns of its own.
  PL_.resize(n, kGaugeFreedoms);
  PL_.leftCols<3>() = covariance.view().middleCols<3>(CameraError::kRotation);
  PL_.col(3).noalias() = covariance.view() * L_.col(3);
}

bool MeasurementUpdate::linearise() {
  stack_.clear();
  const CameraModel lens = model_.corrected(camera_.lens);
  for (const UsableMeasurement& m : measurements_) {
    const auto projection = projectFeature(lens, camera_, features_[m.feature]);
    if (!projection) return false;
    stack_.add(features_[m.feature], *projection);
  }
  return true;
}

void MeasurementUpdate::addNoise(Eigen::MatrixXd& S) {
  second_order_.assign(measurements_.size(), Eigen::Matrix2d::Zero());
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    if (moments_[i](3, 3) > 0.0)
      second_order_[i] = secondOrderNoise(stack_.projection(i), moments_[i]);
    auto block = S.block<2, 2>(2 * i, 2 * i);
    block += second_order_[i] + measurements_[i].variance_px2 * measurements_[i].shape;
  }
}

/// What the impulse, which is anew in each image, makes of the measurements once the rest is known:
/// K = (1 + B^T R^-1 B)^-1 B^T R^-1, for `B` = d(pixels) / d(impulse) and the noise R of one image.
Eigen::Matrix<double, 6, Eigen::Dynamic> MeasurementUpdate::impulseGain(
    const Eigen::MatrixXd& B) const {
  Eigen::Matrix<double, 6, Eigen::Dynamic> weighted = B.transpose();
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    const Eigen::Matrix2d R =
        measurements_[i].variance_px2 * measurements_[i].shape + second_order_[i];
    weighted.middleCols<2>(2 * i) = weighted.middleCols<2>(2 * i) * R.inverse();
  }
  const Eigen::Matrix<double, 6, 6> information =
      Eigen::Matrix<double, 6, 6>::Identity() + weighted * B;
  return information.llt().solve(weighted);
}

/// `weighted`: S^-1 y for the innovation y. Of what the others leave of y_i, the covariance is the
/// inverse of that block of S^-1, and itself that times the block of S^-1 y. `variances_px2` are as
/// expected, those of the measurements as found so far. Whether they, and S, have changed.
bool MeasurementUpdate::weighTails(const Eigen::VectorXd& weighted,
                                   const std::vector<double>& variances_px2, Eigen::MatrixXd& S) {
  const Eigen::MatrixXd inverse_root = inverseRoot(llt_);
  bool any = false;
  noise_left_.clear();
  for (Eigen::Index i = 0; i < weighted.size() / 2; ++i) {
    const Eigen::Matrix2d& shape = measurements_[i].shape;
    const Eigen::Matrix2d left_out = inverseBlock(inverse_root, i).inverse();
    const double expected_px2 = variances_px2[i], found_px2 = measurements_[i].variance_px2;
    const Eigen::Matrix2d expected = left_out - (found_px2 - expected_px2) * shape;
    const Eigen::Vector2d left = left_out * weighted.segment<2>(2 * i);
    const double chi2 = left.dot(expected.inverse() * left);
    const double factor = kTailVariance * (kTailDegrees + chi2) / (kTailDegrees + 2.0);
    const double change_px2 = factor * expected_px2 - found_px2;
    any |= std::abs(change_px2) > kTailTolerance * found_px2;
    measurements_[i].variance_px2 += change_px2;
    S.block<2, 2>(2 * i, 2 * i) += change_px2 * shape;
    // What is left of an innovation y is R S^-1 y, of covariance R S^-1 R.
    noise_left_.push_back(0.5 * measurements_[i].variance_px2 *
                          (shape * (left_out + change_px2 * shape).inverse()).trace());
  }
  return any;
}

/// An image whose matches disagree more than expected on the whole is noisier in all of them: the
/// mean of what a prior as sure as so many degrees of freedom and the innovation's square leave of
/// the scale (inverse gamma).
void MeasurementUpdate::scaleNoise(Eigen::MatrixXd& S) {
  const double degrees = 2.0 * static_cast<double>(measurements_.size());
  const double scale =
      (kDegreesLikeExpected + nis_ / kExpectedInnovation) / (kDegreesLikeExpected + degrees);
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    const double change_px2 = (scale - 1.0) * measurements_[i].variance_px2;
    measurements_[i].variance_px2 += change_px2;
    S.block<2, 2>(2 * i, 2 * i) += change_px2 * measurements_[i].shape;
  }
}

/// How noisy each measurement is, by the first innovation and the S of the noise expected, which
/// then is that of the noise found. False when S could not be factorised.
bool MeasurementUpdate::judgeNoise(const Eigen::VectorXd& innovation, Eigen::MatrixXd& S) {
  Eigen::VectorXd weighted;
  const auto weigh = [&] {
    llt_.compute(S);
    if (llt_.info() != Eigen::Success) return false;
    weighted = llt_.solve(innovation);
    return true;
  };
  if (!weigh()) return false;
  nis_ = innovation.dot(weighted);
  scaleNoise(S);
  if (!weigh()) return false;
  std::vector<double> variances_px2;
  for (const UsableMeasurement& m : measurements_) variances_px2.push_back(m.variance_px2);
  for (int round = 0; round < kMostTailRounds; ++round) {
    const bool has_changed = weighTails(weighted, variances_px2, S);
    if (!weigh()) return false;
    if (!has_changed) break;
  }
  left_px_.clear();
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    const UsableMeasurement& m = measurements_[i];
    const Eigen::Matrix2d root = m.shape.llt().matrixL();  // off which R S^-1 y is taken
    left_px_.push_back(m.variance_px2 * (root.transpose() * weighted.segment<2>(2 * i)));
  }
  return true;
}

bool MeasurementUpdate::step(bool first) {
  stack_.crossCovariance(covariance_, X_);
  Eigen::VectorXd innovation = z_ - stack_.pixels();
  Eigen::MatrixXd S, B = stack_.cameraJacobian().leftCols<kMotion>() * impulse_;
  if (first) {
    S = stack_.innovationCovariance(X_);
  } else {
    // An error of the prior is M = I + C L^T times as large at the mean reached: H M for H.
    const Eigen::MatrixXd HC = stack_.times(C_);
    X_.noalias() += PL_ * HC.transpose();
    S = stack_.innovationCovariance(X_);
    S.noalias() += HC * (L_.transpose() * X_);
    innovation += stack_.times(delta_) + HC * (L_.transpose() * delta_);
    B.noalias() += HC * (L_.topRows<kMotion>().transpose() * impulse_);
  }
  addNoise(S);
  if (first && !judgeNoise(innovation, S)) return false;
  for (std::size_t i = 0; i < measurements_.size(); ++i)
    S.block<2, 2>(2 * i, 2 * i) += measurements_[i].lasting_px2 * measurements_[i].shape;
  llt_.compute(S);
  if (llt_.info() != Eigen::Success) return false;
  // With Q = G G^T the impulse's covariance and K its gain: what the rest leaves is fused by K. Put
  // together, the motion's rows of P H^T grow by G K L, for the lasting noise L, and its covariance
  // by G K L K^T G^T.
  const Eigen::Matrix<double, kMotion, Eigen::Dynamic> GK = impulse_ * impulseGain(B);
  Eigen::Matrix<double, kMotion, Eigen::Dynamic> more = GK;
  for (std::size_t i = 0; i < measurements_.size(); ++i)
    more.middleCols<2>(2 * i) *= measurements_[i].lasting_px2 * measurements_[i].shape;
  X_.topRows<kMotion>() += more;
  added_.noalias() = more * GK.transpose();
  delta_.noalias() = X_ * llt_.solve(innovation);
  delta_.segment<CameraError::kCalibrationSize>(CameraError::kReadout) *= calibration_share_;
  if (!delta_.allFinite()) return false;
  camera_ = prior_camera_;
  features_ = prior_features_;
  applyError(delta_, camera_, features_);
  C_ = gaugeGenerators(camera_, features_, covariance_.size()) - prior_gauge_;
  return true;
}

bool MeasurementUpdate::isLinearEnough(const Eigen::VectorXd& expected) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    sum += (stack_.projection(i).pixel - expected.segment<2>(2 * i)).squaredNorm() /
           measurements_[i].variance_px2;
  }
  return sum < kNonlinearityTolerance * kNonlinearityTolerance * expected.size();
}

bool MeasurementUpdate::solve(int iterations) {
  if (!linearise()) return false;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::VectorXd last_delta = delta_;
    const MeasurementStack last_stack = stack_;
    if (!step(iteration == 0)) return false;
    if (iteration + 1 == iterations || !linearise()) break;
    if (isLinearEnough(last_stack.pixels() + last_stack.times(delta_ - last_delta))) break;
  }
  return true;
}

MotionCovariance MeasurementUpdate::finish() {
  timesTransposeOf(inverseRoot(llt_), X_);
  return added_;
}

}  // namespace active_matching_slam
