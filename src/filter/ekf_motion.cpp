#include <Eigen/Cholesky>
#include <cmath>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

constexpr int kAxes = 3;  // Derivation: of space
/// Of a measurement beyond which it is taken for slip. Standard: one in a thousand (Bar-Shalom, Li
/// & Kirubarajan 2001).
constexpr double kSlipProbability = 0.999;
/// Halvings of the interval in which the inflation is sought. Derivation: of the 64 octaves that
/// are searched they leave 1e-14.
constexpr int kHalvings = 50;
constexpr double kMostOctaves = 64.0;  ///< Derivation: what is inflated more tells nothing

double squared(const Eigen::Vector3d& y, const Eigen::Matrix3d& S) {
  return y.dot(S.llt().solve(y));
}

/// The factor of R by which y^T (S + (factor - 1) R)^-1 y comes down to `limit` (Chang 2014).
double inflationFor(const Eigen::Vector3d& y, const Eigen::Matrix3d& S, const Eigen::Matrix3d& R,
                    double limit) {
  double low = 0.0, high = kMostOctaves;  // of the factor's binary logarithm
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (squared(y, S + (std::exp2(middle) - 1.0) * R) > limit ? low : high) = middle;
  }
  return std::exp2(high);
}

}  // namespace

void Ekf::estimateGyroBias(double initial_sigma_rps) {
  camera_.gyro_bias_rps = Eigen::Vector3d::Zero();
  covariance_.reset(cameraErrorSize(camera_));
  covariance_.view().diagonal().tail<3>().setConstant(initial_sigma_rps * initial_sigma_rps);
  reset(camera_, MotionCovariance::Zero());
}

std::optional<Eigen::Matrix<double, 6, 1>> Ekf::impulse() const {
  if (!impulse_) return std::nullopt;
  return impulse_->variance;
}

void Ekf::loosenScale(double relative_sigma) {
  const Eigen::VectorXd g = gaugeGenerators(camera_, features_, covariance_.size()).col(3);
  auto P = covariance_.view();
  P.noalias() += relative_sigma * relative_sigma * g * g.transpose();
}

double Ekf::scaleSigma() const {
  if (features_.empty()) return 0.0;
  const Eigen::VectorXd functional = gaugeFunctionals(camera_, features_, covariance_).col(3);
  return std::sqrt(std::max(0.0, functional.dot(covariance_.view() * functional)));
}

/// Takes over a correction. What moved the camera is known at the interval's start, from where its
/// pose follows exactly, however far it has turned; lengths as a whole go by their exponential.
void Ekf::applyMotion(const Eigen::VectorXd& delta) {
  const double dt = impulse_->interval_s;
  const Eigen::Matrix3d K = impulse_->q_start.toRotationMatrix() *
                            leftJacobian(camera_.angular_velocity_camera * dt) * dt;
  const Eigen::Vector3d turned = delta.segment<3>(CameraError::kRotation) -
                                 K * delta.segment<3>(CameraError::kAngularVelocity);
  applyError(delta, camera_, features_);
  impulse_->q_start = (rotationFromVector(turned) * impulse_->q_start).normalized();
  camera_.q_world_camera =
      (impulse_->q_start * rotationFromVector(camera_.angular_velocity_camera * dt)).normalized();
}

MotionFusion Ekf::fuseMotion(const Eigen::Matrix<double, 3, Eigen::Dynamic>& H,
                             const Eigen::Vector3d& innovation, const Eigen::Matrix3d& noise,
                             int impulse_row, Corrected corrected, bool* healthy) {
  MotionFusion fusion;
  auto P = covariance_.view();
  const int n = covariance_.size(), size = static_cast<int>(H.cols());
  Eigen::MatrixXd X(n, kAxes + kGaugeFreedoms);
  const Eigen::MatrixXd PHt = P.leftCols(size) * H.transpose();
  Eigen::Matrix3d S = H * PHt.topRows(size) + noise;
  S = 0.5 * (S + S.transpose()).eval();
  Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success || !S.allFinite() || !innovation.allFinite()) {
    *healthy = false;
    return fusion;
  }
  fusion.nis = innovation.dot(llt.solve(innovation));
  fusion.innovation = innovation.norm();
  fusion.innovation_sigma = std::sqrt(S.trace());
  const double limit = chiSquareQuantile(kAxes, kSlipProbability);
  if (fusion.nis > limit) {
    fusion.inflation = inflationFor(innovation, S, noise, limit);
    S += (fusion.inflation - 1.0) * noise;
    llt.compute(S);
  }
  const Eigen::Vector3d weighted = llt.solve(innovation);

  // What it tells of the impulse, in units of its standard deviation (as RobustUpdate does).
  const Eigen::Matrix<double, 3, 6> B = H.leftCols<CameraError::kMotionSize>() * impulse_->G *
                                        impulse_->variance.cwiseSqrt().asDiagonal();
  const Eigen::Matrix<double, 6, 1> resolved =
      (B.transpose() * llt.solve(B)).diagonal().cwiseMin(1.0);
  fusion.impulse.squares = (B.transpose() * weighted).segment<3>(impulse_row).squaredNorm();
  fusion.impulse.degrees = resolved.segment<3>(impulse_row).sum();

  Eigen::VectorXd delta = PHt * weighted;
  X.leftCols<kAxes>() = llt.matrixL().solve(PHt.transpose()).transpose();
  if (!delta.allFinite()) {
    *healthy = false;
    return fusion;
  }
  if (corrected == Corrected::kCamera) {
    delta.tail(n - size).setZero();
    const std::vector<FeatureState> map = features_;
    applyMotion(delta);
    features_ = map;
    *healthy &= correctCameraCovariance(MotionCovariance::Zero(), X.leftCols<kAxes>());
  } else {
    const Eigen::MatrixXd before = gaugeGenerators(camera_, features_, n);
    const Eigen::MatrixXd L = gaugeFunctionals(camera_, features_, covariance_);
    const Eigen::MatrixXd PL = P * L;
    const double growth = L.col(3).dot(delta);
    applyMotion(delta - growth * before.col(3));
    const double factor = std::exp(growth);
    camera_.position_world *= factor;
    camera_.velocity_world *= factor;
    for (FeatureState& feature : features_) feature.rescale(factor);
    const Eigen::MatrixXd change = gaugeGenerators(camera_, features_, n) - before;
    *healthy &= correctCovariance(change, L, PL, MotionCovariance::Zero(), kAxes, X);
    limitInverseDepths();
  }
  // What is left of the impulse: no more than of the velocity as a whole.
  const Eigen::Matrix<double, 6, 1> left = P.diagonal().segment<6>(CameraError::kVelocity);
  impulse_->variance =
      impulse_->variance.cwiseProduct(Eigen::Matrix<double, 6, 1>::Ones() - resolved);
  impulse_->variance = impulse_->variance.cwiseMin(left).cwiseMax(0.0);
  return fusion;
}

MotionReport Ekf::measureMotion(const MotionMeasurement& motion, Corrected corrected) {
  MotionReport report;
  if (!impulse_) return report;
  constexpr int kLinear = 0, kAngular = 3;  // Derivation: rows of the impulse
  const bool has_bias = motion.is_biased && camera_.gyro_bias_rps.has_value();
  Eigen::Matrix<double, 3, Eigen::Dynamic> H =
      Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, cameraErrorSize(camera_));
  H.middleCols<3>(CameraError::kAngularVelocity).setIdentity();
  Eigen::Vector3d expected = camera_.angular_velocity_camera;
  if (has_bias) {
    covariance_.view().diagonal().segment<3>(CameraError::kGyroBias).array() +=
        motion.bias_walk_rps * motion.bias_walk_rps;
    H.middleCols<3>(CameraError::kGyroBias).setIdentity();
    expected += *camera_.gyro_bias_rps;
  }
  report.rotation =
      fuseMotion(H, motion.angular_velocity_camera.mean - expected,
                 motion.angular_velocity_camera.covariance, kAngular, corrected, &report.healthy);
  if (!motion.velocity_start) return report;

  // z = R_s^T v for the rotation R_s at the interval's start, whose error is that of the rotation
  // now but for what the angular velocity's has added since. No rotation of the world changes it.
  const double dt = impulse_->interval_s;
  const Eigen::Matrix3d R_start = impulse_->q_start.toRotationMatrix();
  const Eigen::Matrix3d by_rotation = R_start.transpose() * skew(camera_.velocity_world);
  H.setZero();
  H.middleCols<3>(CameraError::kVelocity) = R_start.transpose();
  H.middleCols<3>(CameraError::kRotation) = by_rotation;
  H.middleCols<3>(CameraError::kAngularVelocity) =
      -by_rotation * R_start * leftJacobian(camera_.angular_velocity_camera * dt) * dt;
  report.translation =
      fuseMotion(H, motion.velocity_start->mean - R_start.transpose() * camera_.velocity_world,
                 motion.velocity_start->covariance, kLinear, corrected, &report.healthy);
  return report;
}

}  // namespace active_matching_slam
