#include "active_matching_slam/initialisation/bundle_adjustment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/math/triangular.h"
#include "bundle_equations.h"

namespace active_matching_slam {
namespace {

/// Cost: of iterations that can't help any more; damping relative to the diagonal.
constexpr double kMinimumDamping = 1e-9, kMaximumDamping = 1e8;
/// Limit to which features' errors are winsorised [median]. Standard: three sigma.
constexpr double kOutlyingFeature = 3.0;
/// Points that the prior of an image's relative variance, 1, counts for. Derivation: five determine
/// a motion, as many again check it.
constexpr double kPriorPoints = 10.0;

/// Solves for the Levenberg-Marquardt step. False when not positive definite.
bool solveStep(const NormalEquations& N, double damping, Eigen::VectorXd* cameras,
               Eigen::VectorXd* features) {
  const auto reduced = eliminateFeatures(N, damping);
  if (!reduced) return false;
  Eigen::VectorXd g(N.feature_gradient.size());  // L^-1 g
  for (std::size_t i = 0; i < N.features.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    g.segment<3>(row) = reduced->inverse_roots[i] * N.feature_gradient.segment<3>(row);
  }
  *cameras = reduced->factor.solve(N.camera_gradient - reduced->cross * g);
  *features = g - reduced->cross.transpose() * *cameras;
  for (std::size_t i = 0; i < N.features.size(); ++i) {
    auto step = features->segment<3>(static_cast<Eigen::Index>(3 * i));
    step = (reduced->inverse_roots[i].transpose() * step).eval();
  }
  return cameras->allFinite() && features->allFinite();
}

void applyStep(const BundleOptions& options, const Eigen::VectorXd& cameras,
               const Eigen::VectorXd& features, Bundle* bundle) {
  for (std::size_t k = 1; k < bundle->cameras.size(); ++k) {
    CameraState& camera = bundle->cameras[k];
    const auto step = cameras.segment<6>(6 * static_cast<Eigen::Index>(k - 1));
    camera.position_world += step.head<3>();
    camera.q_world_camera =
        (rotationFromVector(step.tail<3>()) * camera.q_world_camera).normalized();
  }
  bundle->calibration += cameras.tail<kCalibrationSize>();
  for (std::size_t i = 0; i < bundle->features.size(); ++i) {
    FeatureState& feature = bundle->features[i];
    const auto step = features.segment<3>(static_cast<Eigen::Index>(3 * i));
    const Eigen::Vector3d direction = feature.tangentBasis() * step.head<2>();
    const Eigen::Quaterniond turn = rotationFromVector(feature.bearing_world.cross(direction));
    feature.bearing_world = (turn * feature.bearing_world).normalized();
    const Eigen::Vector3d tangent = turn * feature.tangent_world;
    feature.tangent_world =
        (tangent - feature.bearing_world * feature.bearing_world.dot(tangent)).normalized();
    feature.inverse_depth =
        std::max(feature.inverse_depth + step[2], options.minimum_inverse_depth);
  }
}

/// Sets the scale that fits the prior of inverse depths best: images look the same in any. Returns
/// by how much the cost falls.
double fitScaleToPrior(const BundleOptions& options, Bundle* bundle) {
  double sum = 0.0, squares = 0.0;
  for (const FeatureState& feature : bundle->features) {
    sum += feature.inverse_depth;
    squares += feature.inverse_depth * feature.inverse_depth;
  }
  const double before = depthCost(options, *bundle);
  if (sum > 0.0) rescaleBundle(squares / (options.inverse_depth * sum), bundle);
  return before - depthCost(options, *bundle);
}

}  // namespace

void rescaleBundle(double factor, Bundle* bundle) {
  for (FeatureState& feature : bundle->features) feature.inverse_depth /= factor;
  for (CameraState& camera : bundle->cameras) camera.position_world *= factor;
}

BundleFit adjustBundle(const CameraModel& model, const BundleOptions& options, Bundle* bundle) {
  double damping = 1e-3;
  fitScaleToPrior(options, bundle);
  NormalEquations N = linearise(model, options, *bundle);
  BundleFit fit{N.cost, false};
  Eigen::VectorXd camera_step, feature_steps;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    if (iteration > 0) N = linearise(model, options, *bundle);
    const std::vector<CameraState> cameras = bundle->cameras;
    const std::vector<FeatureState> features = bundle->features;
    const CalibrationVector calibration = bundle->calibration;
    double decrease = 0.0;
    while (!(decrease > 0.0) && damping < kMaximumDamping) {
      if (solveStep(N, damping, &camera_step, &feature_steps)) {
        applyStep(options, camera_step, feature_steps, bundle);
        decrease = fit.cost - bundleCost(model, options, *bundle);
        if (!(decrease > 0.0)) {
          bundle->cameras = cameras;
          bundle->features = features;
          bundle->calibration = calibration;
        }
      }
      damping = decrease > 0.0 ? std::max(0.1 * damping, kMinimumDamping) : 10.0 * damping;
    }
    if (decrease > 0.0) decrease += fitScaleToPrior(options, bundle);
    fit.cost -= std::max(decrease, 0.0);
    fit.converged = !(decrease > options.least_relative_decrease * fit.cost);
    if (fit.converged) break;
  }
  return fit;
}

Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera, double variance_inflation,
                                 const Eigen::VectorXd& scale_weights,
                                 double relative_scale_sigma) {
  BundleOptions inflated = options;
  inflated.sigma_px *= std::sqrt(variance_inflation);
  inflated.loss_scale_sigmas /= std::sqrt(variance_inflation);  // the same weights
  const NormalEquations N = linearise(model, inflated, bundle);
  const LensVector lens_information = calibrationInformation(options).tail<kLensSize>();
  const auto reduced = eliminateFeatures(N, 0.0, &lens_information);
  if (!reduced) return {};
  const int cameras = static_cast<int>(N.cameras.rows()), kept = cameras - 6 * (first_camera - 1);
  const int F = static_cast<int>(N.features.size());
  // With S = R R^T the cameras' equations, W the cross terms and B = diag(L^-1), the covariance is
  // M M^T + diag(0, B^T B), where M = [1, -W L^-T B]^T R^-T.
  Eigen::MatrixXd M(kept + 3 * F, cameras);
  M.topRows(kept) = Eigen::MatrixXd::Identity(cameras, cameras).bottomRows(kept);
  for (int i = 0; i < F; ++i) {
    M.middleRows<3>(kept + 3 * i).noalias() = -reduced->inverse_roots[i].transpose().lazyProduct(
        reduced->cross.middleCols<3>(3 * i).transpose());
  }
  timesTransposeOf(inverseRoot(reduced->factor), M);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(M.rows(), M.rows());
  auto lower = covariance.selfadjointView<Eigen::Lower>();
  lower.rankUpdate(M);
  for (int i = 0; i < F; ++i)
    covariance.block<3, 3>(kept + 3 * i, kept + 3 * i) +=
        reduced->inverse_roots[i].transpose() * reduced->inverse_roots[i];
  // The gauge is one more measurement.
  Eigen::VectorXd gauge = Eigen::VectorXd::Zero(M.rows());
  for (int i = 0; i < F; ++i)
    gauge[kept + 3 * i + 2] = scale_weights[i] / bundle.features[i].inverse_depth;
  const Eigen::VectorXd along = lower * gauge;
  lower.rankUpdate(along, -1.0 / (relative_scale_sigma * relative_scale_sigma + gauge.dot(along)));
  covariance.triangularView<Eigen::StrictlyUpper>() = covariance.transpose();
  return covariance;
}

Eigen::VectorXd depthInformation(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle) {
  const NormalEquations N = linearise(model, options, bundle);
  Eigen::VectorXd information(N.features.size());
  for (Eigen::Index i = 0; i < information.size(); ++i)
    information[i] = std::pow(bundle.features[i].inverse_depth, 2) / N.features[i].inverse()(2, 2);
  return information;
}

std::vector<double> featureErrors(const CameraModel& model, const Bundle& bundle) {
  std::vector<double> sums(bundle.features.size(), 0.0), counts(bundle.features.size(), 0.0);
  forEachResidual(model, bundle, [&](std::size_t, const BundleObservation& o, double squared_px2) {
    if (!std::isfinite(squared_px2)) return;
    sums[o.feature] += 0.5 * squared_px2;
    counts[o.feature] += 1.0;
  });
  for (std::size_t i = 0; i < sums.size(); ++i)
    if (counts[i] > 0.0) sums[i] = std::sqrt(sums[i] / counts[i]);
  return sums;
}

double estimateSigma(const CameraModel& model, const Bundle& bundle) {
  std::vector<double> errors_px = featureErrors(model, bundle);
  errors_px.erase(std::remove(errors_px.begin(), errors_px.end(), 0.0), errors_px.end());
  if (errors_px.empty()) return 0.0;
  double equations = 0.0;
  for (const auto& observations : bundle.observations)
    equations += 2.0 * static_cast<double>(observations.size());
  const double features = static_cast<double>(errors_px.size());
  const double unknowns =
      3.0 * features + 6.0 * (static_cast<double>(bundle.cameras.size()) - 1.0) - 1.0;
  const double freedom = std::max(equations - unknowns, 0.1 * equations);
  const double limit_px = kOutlyingFeature * medianOf(errors_px);
  double squares = 0.0;
  for (const double error_px : errors_px) squares += std::pow(std::min(error_px, limit_px), 2);
  return std::sqrt(squares / features * equations / freedom);
}

void estimateImageVariances(const CameraModel& model, Bundle* bundle) {
  const double limit_px = kOutlyingFeature * medianOf(featureErrors(model, *bundle));
  std::vector<double> squares(bundle->cameras.size(), 0.0);
  forEachResidual(model, *bundle, [&](std::size_t k, const BundleObservation&, double squared_px2) {
    squares[k] += std::min(0.5 * squared_px2, limit_px * limit_px);
  });
  std::vector<double> variances;
  for (std::size_t k = 1; k < squares.size(); ++k)
    variances.push_back(squares[k] / static_cast<double>(bundle->observations[k].size()));
  const double median = medianOf(variances);
  if (!(median > 0.0)) return;
  for (std::size_t k = 1; k < squares.size(); ++k) {
    const double points = static_cast<double>(bundle->observations[k].size());
    const double sigma =
        std::sqrt((kPriorPoints + points * variances[k - 1] / median) / (kPriorPoints + points));
    for (BundleObservation& o : bundle->observations[k]) o.relative_sigma *= sigma;
  }
}

void alignRotation(const CameraModel& model, int index, Bundle* bundle) {
  CameraState& camera = bundle->cameras[index];
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  for (const BundleObservation& o : bundle->observations[index]) {
    const auto ray = model.unproject(o.pixel);
    if (!ray) continue;
    const FeatureState& feature = bundle->features[o.feature];
    const Eigen::Vector3d direction =
        (feature.bearing_world - feature.inverse_depth * camera.position_world).normalized();
    correlation += direction * ray->normalized().transpose();
  }
  // Kabsch's rotation of rays onto directions.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1.0, 1.0, 1.0);
  sign.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  camera.q_world_camera = Eigen::Quaterniond(R).normalized();
}

}  // namespace active_matching_slam
