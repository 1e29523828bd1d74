#include <algorithm>
#include <cmath>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/state_error.h"
#include "robust_update.h"

namespace active_matching_slam {
namespace {

/// Linearisations at most where one is asked to start elsewhere. Cost: each takes as long as an
/// update; they end as soon as they have converged.
constexpr int kStartedIterations = 8;

}  // namespace

PredictedMeasurements Ekf::predictMeasurements(const CameraModel& camera,
                                               const std::vector<FeatureId>& ids, double sigma_px,
                                               const std::optional<Accelerations>& instead) const {
  PredictedMeasurements predicted;
  const CameraModel lens = camera.corrected(camera_.lens);
  MeasurementStack stack;
  for (const FeatureId id : ids) {
    const FeatureState* feature = find(id);
    if (feature == nullptr) continue;
    const auto projection = projectFeature(lens, camera_, *feature);
    if (!projection) continue;
    stack.add(*feature, *projection);
    predicted.ids.push_back(id);
  }
  predicted.z = stack.pixels();
  Eigen::MatrixXd PHt(covariance_.size(), stack.rows());
  stack.crossCovariance(covariance_, PHt);
  predicted.S = stack.innovationCovariance(PHt);
  if (!(sigma_px > 0.0)) sigma_px = options_.sigma_px;
  predicted.S.diagonal().array() += sigma_px * sigma_px;
  for (std::size_t i = 0; i < predicted.ids.size(); ++i) {
    const FeatureState& feature = *find(predicted.ids[i]);
    if (feature.kind != FeatureKind::kInverseDepth) continue;
    predicted.S.block<2, 2>(2 * i, 2 * i) +=
        secondOrderNoise(stack.projection(i), relativeCovariance(feature, covariance_));
  }
  if (impulse_)
    predicted.impulse_px =
        stack.cameraJacobian().leftCols<CameraError::kMotionSize>() * impulse_->G;
  if (instead && impulse_) {
    const Eigen::MatrixXd& A = predicted.impulse_px;
    const Eigen::Matrix<double, 6, 1> more =
        impulseVariance(*instead, impulse_->interval_s) - impulse_->variance;
    predicted.S.triangularView<Eigen::Lower>() += A * (more.asDiagonal() * A.transpose());
  }
  predicted.S.triangularView<Eigen::StrictlyUpper>() = predicted.S.transpose();
  return predicted;
}

UpdateReport Ekf::update(const CameraModel& camera,
                         const std::vector<FeatureMeasurement>& measurements,
                         const NoisePrior& noise, Corrected corrected,
                         const Eigen::VectorXd& start) {
  UpdateReport report;
  const bool is_started = start.size() == covariance_.size() && start.allFinite();
  CameraState from = camera_;
  std::vector<FeatureState> moved;
  if (is_started) {
    moved = features_;
    applyError(start, from, moved);
  }
  const std::vector<FeatureState>& start_features = is_started ? moved : features_;
  const CameraModel lens = camera.corrected(from.lens);
  std::vector<UsableMeasurement> usable;
  std::vector<std::size_t> given;  // places of those in `measurements`
  report.redundancy.assign(measurements.size(), 0.0);
  report.residual_px.assign(measurements.size(), Eigen::Vector2d::Zero());
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const FeatureMeasurement& m = measurements[i];
    const int index = indexOf(m.id);
    if (index < 0 || !m.pixel.allFinite() || !std::isfinite(m.sigma_px) ||
        !m.noise_shape.allFinite())
      continue;
    if (!projectFeature(lens, from, start_features[index])) continue;
    const double sigma_px = m.sigma_px > 0.0 ? m.sigma_px : options_.sigma_px;
    usable.push_back(
        {index, m.pixel, sigma_px * sigma_px, std::max(1.0, m.variance_inflation), m.noise_shape});
    given.push_back(i);
  }
  report.skipped = static_cast<int>(measurements.size() - usable.size());
  if (usable.empty()) return report;

  const int n = covariance_.size();
  const int rows = 2 * static_cast<int>(usable.size());
  const std::size_t room = static_cast<std::size_t>(n) * (rows + kGaugeFreedoms);
  if (workspace_.size() < room) workspace_.resize(room);
  Eigen::Map<Eigen::MatrixXd> X(workspace_.data(), n, rows + kGaugeFreedoms);
  ImpulseRoot impulse = ImpulseRoot::Zero();
  if (impulse_) impulse = impulse_->G * impulse_->variance.cwiseSqrt().asDiagonal();
  RobustUpdate correction(camera, camera_, features_, covariance_, usable, noise, impulse,
                          X.leftCols(rows));
  if (corrected == Corrected::kCamera) correction.considerMap();
  if (is_started) correction.startAt(start);
  if (!correction.solve(is_started ? kStartedIterations : options_.update_iterations)) {
    report.healthy = false;
    return report;
  }
  for (std::size_t i = 0; i < given.size(); ++i) {
    report.redundancy[given[i]] = correction.redundancy()[i];
    report.residual_px[given[i]] = correction.residualsPx()[i];
  }
  report.noise_scale = correction.noiseScale();
  report.noise_degrees = correction.noiseDegrees();
  report.linear = correction.linearImpulse();
  report.angular = correction.angularImpulse();
  const MotionCovariance added = correction.finish();
  impulse_.reset();
  camera_ = correction.camera();
  features_ = correction.features();
  report.nis = correction.nis();
  report.used = static_cast<int>(usable.size());
  report.healthy = corrected == Corrected::kCamera
                       ? correctCameraCovariance(added, X.leftCols(rows))
                       : correctCovariance(correction.gaugeChange(), correction.gaugeFunctionals(),
                                           correction.gaugeCovariance(), added, rows, X);
  limitInverseDepths();
  return report;
}

bool Ekf::correctCovariance(const Eigen::MatrixXd& C, const Eigen::MatrixXd& L,
                            const Eigen::MatrixXd& PL, const MotionCovariance& added, int columns,
                            Eigen::Ref<Eigen::MatrixXd> X) {
  constexpr int kMotion = CameraError::kMotionSize;
  auto P = covariance_.view();
  const Eigen::VectorXd variances_before = P.diagonal();
  const auto measured = X.leftCols(columns);

  // With P' = P - X X^T + D: M P' M^T = P' + C Y^T + Y C^T for Y = P' L + C (L^T P' L) / 2, and
  // each column adds a difference of two squares: c y^T + y c^T = (a a^T - b b^T) / 2 with a = s c
  // + y / s, b = s c - y / s. The b join the columns of X.
  Eigen::MatrixXd Y = PL - measured * (measured.transpose() * L);
  Y.topRows<kMotion>() += added * L.topRows<kMotion>();
  Y += 0.5 * C * (L.transpose() * Y).eval();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(P.rows(), kGaugeFreedoms);
  auto B = X.middleCols<kGaugeFreedoms>(columns);
  B.setZero();
  for (int k = 0; k < kGaugeFreedoms; ++k) {
    const double norm_c = C.col(k).norm(), norm_y = Y.col(k).norm();
    if (norm_c == 0.0 || norm_y == 0.0) continue;
    const double s = std::sqrt(0.5 * norm_y / norm_c);
    A.col(k) = s * C.col(k) + 0.5 / s * Y.col(k);
    B.col(k) = s * C.col(k) - 0.5 / s * Y.col(k);
  }
  P.selfadjointView<Eigen::Lower>().rankUpdate(X, -1.0);
  P.selfadjointView<Eigen::Lower>().rankUpdate(A, 1.0);
  P.topLeftCorner<kMotion, kMotion>() += added;
  const bool sound = repairVariances(variances_before);
  covariance_.mirrorLower();
  return sound;
}

bool Ekf::correctCameraCovariance(const MotionCovariance& added, const Eigen::MatrixXd& X) {
  auto P = covariance_.view();
  const Eigen::VectorXd variances_before = P.diagonal();
  P.leftCols<CameraError::kSize>().noalias() -= X * X.topRows<CameraError::kSize>().transpose();
  if (camera_.gyro_bias_rps)
    P.middleCols<3>(CameraError::kGyroBias).noalias() -=
        X * X.middleRows<3>(CameraError::kGyroBias).transpose();
  P.topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>() += added;
  const bool sound = repairVariances(variances_before);
  covariance_.mirrorLower();
  return sound;
}

bool Ekf::repairVariances(const Eigen::VectorXd& before) {
  constexpr double kRounding = 1e-9;  // Derivation: sums of some hundred terms leave 1e-13
  auto P = covariance_.view();
  bool sound = true;
  for (int i = 0; i < P.rows(); ++i) {
    if (P(i, i) >= 0.0) continue;
    if (P(i, i) >= -kRounding * before[i]) {
      P(i, i) = 0.0;
      continue;
    }
    // Safe, if wasteful: forget what the variable shares with others, keep what was known before.
    P.col(i).tail(P.rows() - i).setZero();
    P.row(i).head(i).setZero();
    P(i, i) = before[i];
    sound = false;
  }
  return sound;
}

void Ekf::limitInverseDepths() {
  for (FeatureState& feature : features_) {
    if (feature.kind == FeatureKind::kInverseDepth)
      feature.inverse_depth = std::max(feature.inverse_depth, options_.minimum_inverse_depth);
  }
}

}  // namespace active_matching_slam
