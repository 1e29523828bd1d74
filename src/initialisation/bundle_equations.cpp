#include "bundle_equations.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/filter/measurement_model.h"

namespace active_matching_slam {
namespace {

/// Information of every bearing [1/rad^2], so that one that no image shows stays; standard
/// deviation of what is held; cost of an image point whose feature does not project. Derivation:
/// negligible beside a pixel's, and beyond any residual's, in doubles.
constexpr double kBearingInformation = 1e-2, kHeldSigma = 1e-8, kCostOfInvisible = 1e3;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrationSize, kCalibrationSize>;
using CalibrationByPose = Eigen::Matrix<double, kCalibrationSize, 6>;

/// An image point linearised about the present state.
struct LinearPoint {
  Matrix26 d_pose;
  Matrix23 d_feature;
  Eigen::Vector2d residual_px;
  Eigen::Matrix2d information;  ///< times the loss's weight [1/px^2]
  double cost = 0.0;
};

/// Cauchy's loss of a squared residual in sigmas.
double robustCost(const BundleOptions& options, double squared_px2) {
  const double limit = std::pow(options.loss_scale_sigmas, 2);
  return limit * std::log1p(squared_px2 / (limit * options.sigma_px * options.sigma_px));
}

/// Empty when the feature does not project.
std::optional<LinearPoint> linearPoint(const CameraModel& model, const BundleOptions& options,
                                       const Bundle& bundle, const Eigen::Vector3d& position_world,
                                       const Eigen::Matrix3d& R_world_camera,
                                       const BundleObservation& o) {
  LinearPoint point;
  const auto projection = projectFromPose(model, position_world, R_world_camera,
                                          bundle.features[o.feature], &point.d_pose);
  if (!projection) return std::nullopt;
  point.d_feature = projection->d_feature.leftCols<3>();
  point.residual_px = correctedPixel(bundle, o) - projection->pixel;
  const double squared_px2 = whitenedSquare(o, point.residual_px);
  const double sigma_px = options.sigma_px * o.relative_sigma;
  const double limit_px = options.loss_scale_sigmas * options.sigma_px;
  const double weight = 1.0 / (1.0 + squared_px2 / (limit_px * limit_px));
  point.information = weight / (sigma_px * sigma_px) * o.inverse_shape;
  point.cost = robustCost(options, squared_px2);
  return point;
}

void addPriors(const BundleOptions& options, const Bundle& bundle, NormalEquations* N) {
  const CalibrationVector information = calibrationInformation(options);
  const CalibrationVector gradient = information.cwiseProduct(bundle.calibration);
  N->cameras.diagonal().tail<kCalibrationSize>() += information;
  N->camera_gradient.tail<kCalibrationSize>() -= gradient;
  N->cost += depthCost(options, bundle) + bundle.calibration.dot(gradient);
  const double weight = 1.0 / (options.sigma_inverse_depth * options.sigma_inverse_depth);
  for (std::size_t i = 0; i < bundle.features.size(); ++i) {
    N->features[i].diagonal() += Eigen::Vector3d(kBearingInformation, kBearingInformation, weight);
    N->feature_gradient[3 * static_cast<Eigen::Index>(i) + 2] +=
        weight * (options.inverse_depth - bundle.features[i].inverse_depth);
  }
  if (!options.rotation_only) return;
  for (std::size_t k = 0; k + 1 < bundle.cameras.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(6 * k);
    N->cameras.diagonal().segment<3>(row).array() += 1.0 / (kHeldSigma * kHeldSigma);
    N->camera_gradient.segment<3>(row).setZero();
  }
}

}  // namespace

CalibrationVector calibrationInformation(const BundleOptions& options) {
  return options.sigma_calibration.cwiseMax(kHeldSigma).array().square().inverse();
}

double depthCost(const BundleOptions& options, const Bundle& bundle) {
  double squares = 0.0;
  for (const FeatureState& feature : bundle.features)
    squares += std::pow(feature.inverse_depth - options.inverse_depth, 2);
  return squares / (options.sigma_inverse_depth * options.sigma_inverse_depth);
}

double bundleCost(const CameraModel& model, const BundleOptions& options, const Bundle& bundle) {
  double cost =
      depthCost(options, bundle) +
      bundle.calibration.dot(calibrationInformation(options).cwiseProduct(bundle.calibration));
  forEachResidual(model, bundle, [&](std::size_t, const BundleObservation&, double squared_px2) {
    cost += std::isfinite(squared_px2) ? robustCost(options, squared_px2) : kCostOfInvisible;
  });
  return cost;
}

NormalEquations linearise(const CameraModel& model, const BundleOptions& options,
                          const Bundle& bundle) {
  const int K = static_cast<int>(bundle.cameras.size()) - 1;
  const int F = static_cast<int>(bundle.features.size());
  NormalEquations N;
  const int C = 6 * K + kCalibrationSize;
  N.cameras = Eigen::MatrixXd::Zero(C, C);
  N.camera_gradient = Eigen::VectorXd::Zero(C);
  N.features.assign(F, Eigen::Matrix3d::Zero());
  N.feature_gradient = Eigen::VectorXd::Zero(3 * F);
  N.cross = Eigen::MatrixXd::Zero(C, 3 * F);
  CalibrationMatrix calibration = CalibrationMatrix::Zero();
  auto calibration_features = N.cross.bottomRows<kCalibrationSize>();
  for (int k = 0; k <= K; ++k) {
    const Eigen::Matrix3d R = bundle.cameras[k].q_world_camera.toRotationMatrix();
    Matrix6 pose = Matrix6::Zero();
    CalibrationByPose calibration_pose = CalibrationByPose::Zero();
    Vector6 pose_gradient = Vector6::Zero();
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto point =
          linearPoint(model, options, bundle, bundle.cameras[k].position_world, R, o);
      if (!point) {
        N.cost += kCostOfInvisible;
        continue;
      }
      N.cost += point->cost;
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
  addPriors(options, bundle, &N);
  return N;
}

std::optional<ReducedEquations> eliminateFeatures(const NormalEquations& equations, double damping,
                                                  const LensVector* lens_information) {
  ReducedEquations reduced;
  reduced.cross.resize(equations.cross.rows(), equations.cross.cols());
  reduced.inverse_roots.reserve(equations.features.size());
  for (std::size_t i = 0; i < equations.features.size(); ++i) {
    Eigen::Matrix3d H = equations.features[i];
    H.diagonal() *= 1.0 + damping;
    const Eigen::LLT<Eigen::Matrix3d> root(H);
    if (root.info() != Eigen::Success) return std::nullopt;
    reduced.inverse_roots.push_back(root.matrixL().solve(Eigen::Matrix3d::Identity()));
    const auto column = static_cast<Eigen::Index>(3 * i);
    reduced.cross.middleCols<3>(column).noalias() =
        equations.cross.middleCols<3>(column).lazyProduct(reduced.inverse_roots[i].transpose());
  }
  Eigen::MatrixXd S = equations.cameras;
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
