#include "robust_update.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/triangular.h"

namespace active_matching_slam {
namespace {

constexpr int kMotion = CameraError::kMotionSize;
/// Linearised anew while the last linearisation erred in the predictions by more than this fraction
/// of their standard deviation, root mean square. Cost: each costs as much as a whole update.
constexpr double kNonlinearityTolerance = 0.2;
/// Degrees of freedom of the t distribution of errors (Standard: Lange, Little & Taylor 1989).
constexpr double kTailDegrees = 4.0;
/// Factor of all variances by which the covariance is right where errors are Gaussian after all.
/// Derivation: for weights w(x) = 6 / (4 + x), x chi-square of 2 degrees, the estimate is taken to
/// have the variance 1 / E[w], E[w] = 1.0840, and has E[w^2 x / 2] / E[w + x w']^2 = 1.0919 (Huber
/// 1981); their ratio.
constexpr double kTailVariance = 1.1836;
/// Mean of a Gaussian error's weighted square per degree of freedom. Derivation: E[w x] / 2.
constexpr double kTailSquare = 0.8320;
constexpr double kTailTolerance = 0.02;  ///< Cost: of the variances, where reweighing ends
constexpr int kMostTailRounds = 4;       ///< Cost

}  // namespace

RobustUpdate::RobustUpdate(const CameraModel& model, const CameraState& camera,
                           const std::vector<FeatureState>& features,
                           const CovarianceMatrix& covariance,
                           std::vector<UsableMeasurement> measurements, const NoisePrior& noise,
                           const ImpulseRoot& impulse, Eigen::Ref<Eigen::MatrixXd> X)
    : model_(model),
      prior_camera_(camera),
      prior_features_(features),
      covariance_(covariance),
      measurements_(std::move(measurements)),
      noise_(noise),
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

bool RobustUpdate::linearise() {
  stack_.clear();
  const CameraModel lens = model_.corrected(camera_.lens);
  for (const UsableMeasurement& m : measurements_) {
    const auto projection = projectFeature(lens, camera_, features_[m.feature]);
    if (!projection) return false;
    stack_.add(features_[m.feature], *projection);
  }
  return true;
}

void RobustUpdate::addNoise(Eigen::MatrixXd& S) {
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
Eigen::Matrix<double, 6, Eigen::Dynamic> RobustUpdate::impulseGain(const Eigen::MatrixXd& B) const {
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

/// `weighted`: S^-1 y for the innovation y. The leave-one-out residual e of measurement i is
/// ([S^-1]_ii)^-1 [S^-1 y]_i, of covariance C = ([S^-1]_ii)^-1. `expected_px2`: R before tails,
/// `applied` times the prior's. Whether R, and S, have changed.
///
/// Variance component estimation of the scale: with q = C^-1 e, R q^T q has the mean tr(R C^-1),
/// twice the redundancy number; weighted, kTailSquare of it. C is with R before tails: else what
/// the residual itself did to its weight would bias the scale by its redundancy.
bool RobustUpdate::reweigh(const Eigen::VectorXd& weighted, const std::vector<double>& expected_px2,
                           double applied, Eigen::MatrixXd& S) {
  const Eigen::MatrixXd inverse_root = inverseRoot(llt_);
  bool has_changed = false;
  double squares = 0.0;
  noise_degrees_ = 0.0;
  redundancy_.clear();
  for (Eigen::Index i = 0; i < weighted.size() / 2; ++i) {
    UsableMeasurement& m = measurements_[i];
    const Eigen::Matrix2d left_out = inverseBlock(inverse_root, i).inverse();
    const Eigen::Matrix2d C = left_out - (m.variance_px2 - expected_px2[i]) * m.shape;
    const Eigen::Matrix2d C_inverse = C.inverse();
    const Eigen::Vector2d residual = left_out * weighted.segment<2>(2 * i);
    const Eigen::Vector2d q = C_inverse * residual;
    const double weight = (kTailDegrees + 2.0) / (kTailDegrees + residual.dot(q));
    squares += weight * expected_px2[i] * q.dot(m.shape * q);
    noise_degrees_ += expected_px2[i] * (m.shape * C_inverse).trace();

    const double change_px2 = kTailVariance / weight * expected_px2[i] - m.variance_px2;
    has_changed |= std::abs(change_px2) > kTailTolerance * m.variance_px2;
    m.variance_px2 += change_px2;
    S.block<2, 2>(2 * i, 2 * i) += change_px2 * m.shape;
    // The post-fit residual of an innovation y is R S^-1 y, of covariance R S^-1 R.
    redundancy_.push_back(0.5 * m.variance_px2 *
                          (m.shape * (left_out + change_px2 * m.shape).inverse()).trace());
  }
  noise_scale_ = applied * squares / (kTailSquare * noise_degrees_);
  return has_changed;
}

/// Posterior mean of the factor common to all R.
double RobustUpdate::posteriorScale() const {
  if (std::isinf(noise_.degrees)) return 1.0;
  return (noise_.degrees + noise_degrees_ * noise_scale_) / (noise_.degrees + noise_degrees_);
}

/// R of each measurement, by the first innovation; S, which came with the prior's R, has it then.
/// False when S could not be factorised.
bool RobustUpdate::estimateNoise(const Eigen::VectorXd& innovation, Eigen::MatrixXd& S) {
  Eigen::VectorXd weighted;
  const auto weigh = [&] {
    llt_.compute(S);
    if (llt_.info() != Eigen::Success) return false;
    weighted = llt_.solve(innovation);
    return true;
  };
  if (!weigh()) return false;
  nis_ = innovation.dot(weighted);
  std::vector<double> prior_px2;
  for (const UsableMeasurement& m : measurements_) prior_px2.push_back(m.variance_px2);
  std::vector<double> expected_px2(prior_px2.size());
  const double least = std::min(1.0, noise_.minimum_px2 / medianOf(prior_px2));
  double applied = 1.0;
  for (int round = 0; round < kMostTailRounds; ++round) {
    for (std::size_t i = 0; i < expected_px2.size(); ++i) expected_px2[i] = applied * prior_px2[i];
    const bool has_changed = reweigh(weighted, expected_px2, applied, S);
    if (!weigh()) return false;
    if (round > 0 && !has_changed) break;
    applied = std::max(posteriorScale(), least);
  }
  residuals_px_.clear();
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    const UsableMeasurement& m = measurements_[i];
    const Eigen::Matrix2d root = m.shape.llt().matrixL();  // off which R S^-1 y is taken
    residuals_px_.push_back(m.variance_px2 * (root.transpose() * weighted.segment<2>(2 * i)));
  }
  return true;
}

/// The impulse's posterior mean B^T S^-1 y, in units of its standard deviation, has the covariance
/// B^T S^-1 B where the variance allowed for is right. By the last factorisation of S.
void RobustUpdate::estimateImpulse(const Eigen::MatrixXd& B, const Eigen::VectorXd& innovation) {
  const Eigen::MatrixXd root = llt_.matrixL().solve(B);
  const Eigen::Matrix<double, 6, 1> squares =
      (root.transpose() * llt_.matrixL().solve(innovation)).array().square();
  const Eigen::Matrix<double, 6, 1> degrees = root.colwise().squaredNorm();
  linear_impulse_ = {squares.head<3>().sum(), degrees.head<3>().sum()};
  angular_impulse_ = {squares.tail<3>().sum(), degrees.tail<3>().sum()};
}

bool RobustUpdate::step(bool first) {
  stack_.crossCovariance(covariance_, X_);
  Eigen::VectorXd innovation = z_ - stack_.pixels();
  Eigen::MatrixXd S, B = stack_.cameraJacobian().leftCols<kMotion>() * impulse_;
  if (!is_moved_) {
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
  if (first) {
    if (!estimateNoise(innovation, S)) return false;
    estimateImpulse(B, innovation);
  }
  for (std::size_t i = 0; i < measurements_.size(); ++i)
    S.block<2, 2>(2 * i, 2 * i) += measurements_[i].correlatedVariance() * measurements_[i].shape;
  llt_.compute(S);
  if (llt_.info() != Eigen::Success) return false;
  // With Q = G G^T the impulse's covariance and K its gain: what the rest leaves is fused by K. Put
  // together, the motion's rows of P H^T grow by G K L, for the noise L that R is inflated by, and
  // its covariance by G K L K^T G^T.
  const Eigen::Matrix<double, kMotion, Eigen::Dynamic> GK = impulse_ * impulseGain(B);
  Eigen::Matrix<double, kMotion, Eigen::Dynamic> more = GK;
  for (std::size_t i = 0; i < measurements_.size(); ++i)
    more.middleCols<2>(2 * i) *= measurements_[i].correlatedVariance() * measurements_[i].shape;
  X_.topRows<kMotion>() += more;
  added_.noalias() = more * GK.transpose();
  delta_.noalias() = X_ * llt_.solve(innovation);
  if (!delta_.allFinite()) return false;
  moveTo(delta_);
  return true;
}

/// Puts the mean to where `delta` leads from the prior's.
void RobustUpdate::moveTo(const Eigen::VectorXd& delta) {
  is_moved_ = true;
  delta_ = delta;
  if (is_map_considered_) delta_.tail(delta_.size() - cameraErrorSize(camera_)).setZero();
  camera_ = prior_camera_;
  features_ = prior_features_;
  applyError(delta_, camera_, features_);
  if (is_map_considered_) features_ = prior_features_;  // not even rounded
  // The gauge is the map's: where that stands still there is none to be transported.
  if (!is_map_considered_)
    C_ = gaugeGenerators(camera_, features_, covariance_.size()) - prior_gauge_;
}

void RobustUpdate::startAt(const Eigen::VectorXd& start) { moveTo(start); }

bool RobustUpdate::isLinearEnough(const Eigen::VectorXd& expected) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < measurements_.size(); ++i) {
    sum += (stack_.projection(i).pixel - expected.segment<2>(2 * i)).squaredNorm() /
           measurements_[i].variance_px2;
  }
  return sum < kNonlinearityTolerance * kNonlinearityTolerance * expected.size();
}

bool RobustUpdate::solve(int iterations) {
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

MotionCovariance RobustUpdate::finish() {
  timesTransposeOf(inverseRoot(llt_), X_);
  return added_;
}

}  // namespace active_matching_slam
