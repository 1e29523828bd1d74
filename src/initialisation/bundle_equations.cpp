#include "bundle_equations.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {
namespace {

/// Of every bearing [1/rad^2]: one that no image shows stays as it is.
constexpr double kLeastInformation = 1e-2;
constexpr double kLeastSigmaCalibration = 1e-8;  ///< of what is beyond doubt

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrationSize, kCalibrationSize>;
using CalibrationByPose = Eigen::Matrix<double, kCalibrationSize, 6>;

/// An image point and what it tells, about the present state.
struct LinearPoint {
  Matrix26 d_pose;
  Matrix23 d_feature;
  Eigen::Vector2d residual_px;
  double squared_px2 = 0.0;     ///< squaredMiss()
  Eigen::Matrix2d information;  ///< [1/px^2]
  double robust = 0.0;          ///< share of it that is left for what is off by so much
};

/// Empty when the feature does not project.
std::optional<LinearPoint> linearPoint(const CameraModel& model, const BundleOptions& options,
                                       const Bundle& bundle, std::size_t image,
                                       const Eigen::Matrix3d& R_world_camera,
                                       const BundleObservation& o) {
  LinearPoint point;
  const auto projection =
      projectFromPose(model, bundle.cameras[image].position_world, R_world_camera,
                      bundle.features[o.feature], &point.d_pose);
  if (!projection) return std::nullopt;
  point.d_feature = projection->d_feature.leftCols<3>();
  point.residual_px = plainPixel(bundle, o) - projection->pixel;
  point.squared_px2 = squaredMiss(o, point.residual_px);
  const double sigma_px = options.sigma_px * o.noise;
  point.robust = 1.0 / (1.0 + point.squared_px2 / (options.outlier_px * options.outlier_px));
  point.information = point.robust / (sigma_px * sigma_px) * o.inverse_shape;
  return point;
}

}  // namespace

CalibrationVector calibrationInformation(const BundleOptions& options) {
  return options.sigma_calibration.cwiseMax(kLeastSigmaCalibration).array().square().inverse();
}

double depthCost(const BundleOptions& options, const Bundle& bundle) {
  double squares = 0.0;
  for (const FeatureState& feature : bundle.features)
    squares += std::pow(feature.inverse_depth - options.inverse_depth, 2);
  return squares / (options.sigma_inverse_depth * options.sigma_inverse_depth);
}

double robustCost(const BundleOptions& options, double squared) {
  const double limit = options.outlier_px * options.outlier_px;
  return limit * std::log1p(squared / limit) / (options.sigma_px * options.sigma_px);
}

NormalEquations linearise(const CameraModel& model, const BundleOptions& options,
                          const Bundle& bundle) {
  const int K = static_cast<int>(bundle.cameras.size()) - 1;
  const int F = static_cast<int>(bundle.features.size());
  NormalEquations N;
  const int C = 6 * K + kCalibrationSize;
  N.cameras = Eigen::MatrixXd::Zero(C, C);
  N.camera_gradient = Eigen::VectorXd::Zero(C);
  N.features.assign(F, Eigen::Vector3d(kLeastInformation, kLeastInformation, 0.0).asDiagonal());
  N.feature_gradient = Eigen::VectorXd::Zero(3 * F);
  N.cross = Eigen::MatrixXd::Zero(C, 3 * F);
  const CalibrationVector information = calibrationInformation(options);
  const CalibrationVector pull = information.cwiseProduct(bundle.calibration);
  N.cameras.diagonal().tail<kCalibrationSize>() = information;
  N.camera_gradient.tail<kCalibrationSize>() = -pull;
  N.cost += depthCost(options, bundle) + bundle.calibration.dot(pull);
  for (int i = 0; i < F; ++i) {
    const double weight = 1.0 / (options.sigma_inverse_depth * options.sigma_inverse_depth);
    const double error = options.inverse_depth - bundle.features[i].inverse_depth;
    N.features[i](2, 2) += weight;
    N.feature_gradient[3 * i + 2] += weight * error;
  }
  CalibrationMatrix calibration = CalibrationMatrix::Zero();
  Eigen::Matrix<double, kCalibrationSize, Eigen::Dynamic> calibration_features;
  calibration_features.setZero(kCalibrationSize, 3 * F);
  for (int k = 0; k <= K; ++k) {
    const Eigen::Matrix3d R = bundle.cameras[k].q_world_camera.toRotationMatrix();
    Matrix6 pose = Matrix6::Zero();
    CalibrationByPose calibration_pose = CalibrationByPose::Zero();
    Vector6 pose_gradient = Vector6::Zero();
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto point = linearPoint(model, options, bundle, k, R, o);
      if (!point) {
        N.cost += kCostOfInvisible;
        continue;
      }
      N.cost += robustCost(options, point->squared_px2);
      const Eigen::Vector2d& residual = point->residual_px;
      const Matrix23 &J = point->d_feature, weighted_J = point->information * J;
      N.features[o.feature].noalias() += J.transpose() * weighted_J;
      N.feature_gradient.segment<3>(3 * o.feature) += weighted_J.transpose() * residual;
      const auto& D = o.d_calibration;
      const Eigen::Matrix<double, 2, kCalibrationSize> weighted_D = point->information * D;
      calibration.noalias() += D.transpose() * weighted_D;
      N.camera_gradient.tail<kCalibrationSize>() += weighted_D.transpose() * residual;
      calibration_features.middleCols<3>(3 * o.feature).noalias() += D.transpose() * weighted_J;
      if (k == 0) continue;
      const Matrix26 weighted_pose = point->information * point->d_pose;
      pose.noalias() += point->d_pose.transpose() * weighted_pose;
      calibration_pose.noalias() += D.transpose() * weighted_pose;
      pose_gradient += weighted_pose.transpose() * residual;
      N.cross.block<6, 3>(6 * (k - 1), 3 * o.feature) = point->d_pose.transpose() * weighted_J;
    }
    if (k == 0) continue;
    const int row = 6 * (k - 1);
    N.cameras.block<6, 6>(row, row) = pose;
    N.cameras.block<kCalibrationSize, 6>(6 * K, row) = calibration_pose;
    N.camera_gradient.segment<6>(row) = pose_gradient;
  }
  N.cameras.bottomRightCorner<kCalibrationSize, kCalibrationSize>() += calibration;
  N.cross.bottomRows<kCalibrationSize>() = calibration_features;
  return N;
}

Eigen::VectorXd depthShares(const CameraModel& model, const BundleOptions& options,
                            const Bundle& bundle) {
  const NormalEquations N = linearise(model, options, bundle);
  Eigen::VectorXd shares(bundle.features.size());
  for (Eigen::Index i = 0; i < shares.size(); ++i) {
    const double variance = N.features[i].inverse()(2, 2);
    shares[i] = std::pow(bundle.features[i].inverse_depth, 2) / variance;
  }
  return shares / shares.sum();
}

FeaturePulls pullsOfFeatures(const CameraModel& model, const BundleOptions& options,
                             const Bundle& bundle, const NormalEquations& N,
                             const CameraEquations& reduced, const LastPoseMap& map) {
  const int readout = 6 * (static_cast<int>(bundle.cameras.size()) - 1);
  FeaturePulls pulls;
  pulls.features.resize(bundle.features.size());
  double weights = 0.0, slopes = 0.0, squares = 0.0;
  // One less for each that is estimated.
  double degrees = -6.0 * static_cast<double>(bundle.cameras.size() - 1) -
                   3.0 * static_cast<double>(bundle.features.size());
  for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
    const Eigen::Matrix3d R = bundle.cameras[k].q_world_camera.toRotationMatrix();
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto point = linearPoint(model, options, bundle, k, R, o);
      if (!point) continue;
      weights += point->robust;
      slopes += point->robust * point->robust;
      squares += point->residual_px.dot(point->information * point->residual_px);
      degrees += 2.0;
      Eigen::Matrix<double, kLastPoseSize, 2> J =
          map.col(readout) * o.d_calibration.col(0).transpose();
      if (k > 0) J += map.middleCols<6>(6 * static_cast<int>(k - 1)) * point->d_pose.transpose();
      FeaturePull& pull = pulls.features[o.feature];
      pull.gradient += J * (point->information * point->residual_px);
      pull.information += J * point->information * J.transpose();
    }
  }
  for (std::size_t i = 0; i < bundle.features.size(); ++i) {
    const auto from = static_cast<Eigen::Index>(3 * i);
    const Eigen::Matrix<double, kLastPoseSize, 3> J =
        map * reduced.cross.block(0, from, map.cols(), 3);
    FeaturePull& pull = pulls.features[i];
    pull.gradient -= J * (reduced.inverse_roots[i] * N.feature_gradient.segment<3>(from));
    pull.information -= J * J.transpose();
  }
  if (slopes > 0.0) pulls.yielding = weights / slopes;
  if (degrees > 0.0) pulls.missed = squares / degrees;
  return pulls;
}

/// With the diagonal grown by `damping`. Empty when not positive definite. Given
/// `lens_information`, that is all that is known of the lens once the rest is eliminated.
std::optional<CameraEquations> eliminateFeatures(const BundleMatrix& information, double damping,
                                                 const LensVector* lens_information) {
  CameraEquations reduced;
  reduced.cross.resize(information.cross.rows(), information.cross.cols());
  reduced.inverse_roots.reserve(information.features.size());
  for (std::size_t i = 0; i < information.features.size(); ++i) {
    Eigen::Matrix3d H = information.features[i];
    H.diagonal() *= 1.0 + damping;
    const Eigen::LLT<Eigen::Matrix3d> root(H);
    if (root.info() != Eigen::Success) return std::nullopt;
    reduced.inverse_roots.push_back(root.matrixL().solve(Eigen::Matrix3d::Identity()));
    const auto column = static_cast<Eigen::Index>(3 * i);
    reduced.cross.middleCols<3>(column).noalias() =
        information.cross.middleCols<3>(column).lazyProduct(reduced.inverse_roots[i].transpose());
  }
  Eigen::MatrixXd S = information.cameras;
  S.diagonal() *= 1.0 + damping;
  S.selfadjointView<Eigen::Lower>().rankUpdate(reduced.cross, -1.0);
  if (lens_information != nullptr) {
    const Eigen::Index rest = S.rows() - kLensSize;
    const Eigen::MatrixXd cross = S.bottomLeftCorner(kLensSize, rest);
    const Eigen::LLT<Eigen::MatrixXd> others(S.topLeftCorner(rest, rest));
    S.bottomRightCorner<kLensSize, kLensSize>() = cross * others.solve(cross.transpose());
    S.diagonal().tail<kLensSize>() += *lens_information;
  }
  reduced.factor.compute(S);  // reads the lower triangle
  if (reduced.factor.info() != Eigen::Success) return std::nullopt;
  return reduced;
}

}  // namespace active_matching_slam
