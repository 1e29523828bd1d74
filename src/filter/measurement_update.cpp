#include "measurement_update.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/filter/triangular.h"

namespace active_matching_slam {
namespace {

/// Linearisation is repeated when it missed by more than this, root mean square, in sigmas.
constexpr double kNonlinearityTolerance = 0.2;
/// A measurement's squared distance from what all others say of it, in sigmas; of 2 expected.
constexpr double kStrayChi2 = 9.0;

}  // namespace

MeasurementUpdate::MeasurementUpdate(const CameraModel& model, const CameraState& camera,
                                     const std::vector<FeatureState>& features,
                                     const CovarianceMatrix& covariance,
                                     std::vector<UsableMeasurement> measurements,
                                     double calibration_share, Eigen::Ref<Eigen::MatrixXd> X)
    : model_(model),
      prior_camera_(camera),
      prior_features_(features),
      covariance_(covariance),
      measurements_(std::move(measurements)),
      calibration_share_(calibration_share),
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

void MeasurementUpdate::addNoise(Eigen::MatrixXd& S) const {
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    auto block = S.block<2, 2>(2 * i, 2 * i);
    block.diagonal().array() += measurements_[i].variance_px2;
    if (moments_[i](3, 3) > 0.0) block += secondOrderNoise(stack_.projection(i), moments_[i]);
  }
}

/// `weighted`: S^-1 y for the innovation y. Of what the others leave of y_i, the covariance is the
/// inverse of that block of S^-1, and itself that times the block of S^-1 y. Whether there are any.
bool MeasurementUpdate::doubtStrays(const Eigen::VectorXd& weighted, Eigen::MatrixXd& S) {
  const Eigen::MatrixXd inverse_root = inverseRoot(llt_);
  bool any = false;
  noise_left_.clear();
  for (Eigen::Index i = 0; i < weighted.size() / 2; ++i) {
    const auto columns = inverse_root.block(2 * i, 2 * i, weighted.size() - 2 * i, 2);
    Eigen::Matrix2d inverse = columns.transpose() * columns;  // block of S^-1
    const Eigen::Matrix2d left_out = inverse.inverse();
    const Eigen::Vector2d w = weighted.segment<2>(2 * i);
    const double chi2 = w.dot(left_out * w);
    if (chi2 > kStrayChi2) {
      const double more_px2 = 0.5 * left_out.trace() * (chi2 / kStrayChi2 - 1.0);
      measurements_[i].variance_px2 += more_px2;
      S.block<2, 2>(2 * i, 2 * i).diagonal().array() += more_px2;
      inverse = (left_out + more_px2 * Eigen::Matrix2d::Identity()).inverse();
      any = true;
    }
    // What is left of an innovation y is R S^-1 y, of covariance R S^-1 R.
    noise_left_.push_back(0.5 * measurements_[i].variance_px2 * inverse.trace());
  }
  return any;
}

bool MeasurementUpdate::step(bool first) {
  stack_.crossCovariance(covariance_, X_);
  Eigen::VectorXd innovation = z_ - stack_.pixels();
  Eigen::MatrixXd S;
  if (first) {
    S = stack_.innovationCovariance(X_);
  } else {
    // An error of the prior is M = I + C L^T times as large at the mean reached: H M for H.
    const Eigen::MatrixXd HC = stack_.times(C_);
    X_.noalias() += PL_ * HC.transpose();
    S = stack_.innovationCovariance(X_);
    S.noalias() += HC * (L_.transpose() * X_);
    innovation += stack_.times(delta_) + HC * (L_.transpose() * delta_);
  }
  addNoise(S);
  llt_.compute(S);
  if (llt_.info() != Eigen::Success) return false;
  Eigen::VectorXd weighted = llt_.solve(innovation);
  if (first) {
    nis_ = innovation.dot(weighted);
    if (doubtStrays(weighted, S)) {
      llt_.compute(S);
      if (llt_.info() != Eigen::Success) return false;
      weighted = llt_.solve(innovation);
    }
    left_px_.clear();
    for (std::size_t i = 0; i < measurements_.size(); ++i)
      left_px_.push_back(measurements_[i].variance_px2 * weighted.segment<2>(2 * i));
  }
  for (std::size_t i = 0; i < measurements_.size(); ++i)
    S.diagonal().segment<2>(2 * i).array() += measurements_[i].lasting_px2;
  lasting_llt_.compute(S);
  if (lasting_llt_.info() != Eigen::Success) return false;
  delta_.noalias() = X_ * lasting_llt_.solve(innovation);
  delta_.head<CameraError::kMotionSize>().noalias() =
      X_.topRows<CameraError::kMotionSize>() * weighted;
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

Eigen::MatrixXd MeasurementUpdate::finish() {
  const auto motion = X_.topRows<CameraError::kMotionSize>();
  const Eigen::MatrixXd gain = llt_.solve(motion.transpose());  // transposed
  Eigen::MatrixXd more = gain.transpose() * X_.transpose();
  timesTransposeOf(inverseRoot(lasting_llt_), X_);
  more.noalias() -= motion * X_.transpose();
  return more;
}

}  // namespace active_matching_slam
