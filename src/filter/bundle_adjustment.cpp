#include "active_matching_slam/filter/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/rotation.h"
#include "active_matching_slam/filter/triangular.h"

namespace active_matching_slam {
namespace {

constexpr double kCostOfInvisible = 1e3;  ///< of an image point whose feature does not project
/// Of every bearing [1/rad^2]: one that no image shows stays as it is.
constexpr double kLeastInformation = 1e-2;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

constexpr int kCalibrationSize = CameraError::kCalibrationSize;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrationSize, kCalibrationSize>;
using CalibrationByPose = Eigen::Matrix<double, kCalibrationSize, 6>;
constexpr int kLensSize = kCalibrationSize - 1;  ///< all but the readout
using LensVector = Eigen::Matrix<double, kLensSize, 1>;
constexpr double kLeastSigmaCalibration = 1e-8;  ///< of what is beyond doubt

/// Least squares over (cameras but the first, 6 each, and the calibration; features, 3 each) about
/// the present state. C = 6K + kCalibrationSize.
struct NormalEquations {
  double cost = 0.0;
  Eigen::MatrixXd cameras;                ///< C x C
  Eigen::VectorXd camera_gradient;        ///< C
  std::vector<Eigen::Matrix3d> features;  ///< F blocks
  Eigen::VectorXd feature_gradient;       ///< 3F
  Eigen::MatrixXd cross;                  ///< C x 3F
};

/// Cauchy's function of a squared residual [px^2], in units of the noise: what is far off counts
/// ever less.
double robustCost(const BundleOptions& options, double squared) {
  const double limit = options.outlier_px * options.outlier_px;
  return limit * std::log1p(squared / limit) / (options.sigma_px * options.sigma_px);
}

/// Information [1/px^2] of an image point like most with that residual.
double robustInformation(const BundleOptions& options, double squared) {
  return 1.0 / (options.sigma_px * options.sigma_px) /
         (1.0 + squared / (options.outlier_px * options.outlier_px));
}

/// Where a point would be seen by the calibration as given.
Eigen::Vector2d plainPixel(const Bundle& bundle, const BundleObservation& o) {
  return o.pixel - o.d_calibration * bundle.calibration;
}

/// Of a residual [px], squared, as if the point were as noisy as most.
double squaredMiss(const BundleObservation& o, const Eigen::Vector2d& residual_px) {
  return residual_px.squaredNorm() / (o.noise * o.noise);
}

CalibrationVector calibrationInformation(const BundleOptions& options) {
  return options.sigma_calibration.cwiseMax(kLeastSigmaCalibration).array().square().inverse();
}

/// Of the inverse depths by their prior.
double depthCost(const BundleOptions& options, const Bundle& bundle) {
  double squares = 0.0;
  for (const FeatureState& feature : bundle.features)
    squares += std::pow(feature.inverse_depth - options.inverse_depth, 2);
  return squares / (options.sigma_inverse_depth * options.sigma_inverse_depth);
}

/// Calls visit(image, observation, squaredMiss) for all image points; infinite where the feature
/// does not project.
template <typename Visit>
void forEachMiss(const CameraModel& model, const Bundle& bundle, const Visit& visit) {
  for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
    const CameraState& camera = bundle.cameras[k];
    const Eigen::Matrix3d R_camera_world = camera.q_world_camera.toRotationMatrix().transpose();
    for (const BundleObservation& o : bundle.observations[k]) {
      const FeatureState& feature = bundle.features[o.feature];
      const auto pixel = model.project(
          R_camera_world * (feature.bearing_world - feature.inverse_depth * camera.position_world));
      visit(k, o,
            pixel ? squaredMiss(o, plainPixel(bundle, o) - *pixel)
                  : std::numeric_limits<double>::infinity());
    }
  }
}

double bundleCost(const CameraModel& model, const BundleOptions& options, const Bundle& bundle) {
  double cost =
      depthCost(options, bundle) +
      bundle.calibration.dot(calibrationInformation(options).cwiseProduct(bundle.calibration));
  forEachMiss(model, bundle, [&](std::size_t, const BundleObservation&, double squared_px) {
    cost += std::isfinite(squared_px) ? robustCost(options, squared_px) : kCostOfInvisible;
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
      Matrix26 d_pose;
      const auto projection = projectFromPose(model, bundle.cameras[k].position_world, R,
                                              bundle.features[o.feature], &d_pose);
      if (!projection) {
        N.cost += kCostOfInvisible;
        continue;
      }
      const Eigen::Vector2d residual = plainPixel(bundle, o) - projection->pixel;
      const double squared = squaredMiss(o, residual);
      const double weight = robustInformation(options, squared) / (o.noise * o.noise);
      N.cost += robustCost(options, squared);
      const Matrix23 J = projection->d_feature.leftCols<3>(), weighted_J = weight * J;
      N.features[o.feature].noalias() += J.transpose() * weighted_J;
      N.feature_gradient.segment<3>(3 * o.feature) += weighted_J.transpose() * residual;
      const auto& D = o.d_calibration;
      const Eigen::Matrix<double, 2, kCalibrationSize> weighted_D = weight * D;
      calibration.noalias() += D.transpose() * weighted_D;
      N.camera_gradient.tail<kCalibrationSize>() += weighted_D.transpose() * residual;
      calibration_features.middleCols<3>(3 * o.feature).noalias() += D.transpose() * weighted_J;
      if (k == 0) continue;
      const Matrix26 weighted_pose = weight * d_pose;
      pose.noalias() += d_pose.transpose() * weighted_pose;
      calibration_pose.noalias() += D.transpose() * weighted_pose;
      pose_gradient += weighted_pose.transpose() * residual;
      N.cross.block<6, 3>(6 * (k - 1), 3 * o.feature) = d_pose.transpose() * weighted_J;
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

/// The normal equations of the cameras alone, once the features are eliminated.
struct CameraEquations {
  Eigen::LLT<Eigen::MatrixXd> factor;          ///< C x C
  Eigen::MatrixXd cross;                       ///< W L^-T, where H = L L^T is a feature's block
  std::vector<Eigen::Matrix3d> inverse_roots;  ///< L^-1 of each feature
};

/// With the diagonal grown by `damping`. Empty when not positive definite. Given
/// `lens_information`, that is all that is known of the lens once the rest is eliminated.
std::optional<CameraEquations> eliminateFeatures(const NormalEquations& N, double damping,
                                                 const LensVector* lens_information = nullptr) {
  CameraEquations reduced;
  reduced.cross.resize(N.cross.rows(), N.cross.cols());
  reduced.inverse_roots.reserve(N.features.size());
  for (std::size_t i = 0; i < N.features.size(); ++i) {
    Eigen::Matrix3d H = N.features[i];
    H.diagonal() *= 1.0 + damping;
    const Eigen::LLT<Eigen::Matrix3d> root(H);
    if (root.info() != Eigen::Success) return std::nullopt;
    reduced.inverse_roots.push_back(root.matrixL().solve(Eigen::Matrix3d::Identity()));
    const auto column = static_cast<Eigen::Index>(3 * i);
    reduced.cross.middleCols<3>(column).noalias() =
        N.cross.middleCols<3>(column).lazyProduct(reduced.inverse_roots[i].transpose());
  }
  Eigen::MatrixXd S = N.cameras;
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

/// Solves for the step with the diagonal grown by `damping`. False when not positive definite.
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

/// Root mean squares per axis of what is missed, of all that project.
class MeanSquares {
 public:
  explicit MeanSquares(std::size_t size) : sums_(size, 0.0), counts_(size, 0.0) {}

  void add(std::size_t i, double squared, double most) {
    if (!std::isfinite(squared)) return;
    sums_[i] += std::min(0.5 * squared, most * most);
    counts_[i] += 1.0;
  }

  /// Zero where there are none.
  std::vector<double> roots() const {
    std::vector<double> roots(sums_.size(), 0.0);
    for (std::size_t i = 0; i < roots.size(); ++i)
      if (counts_[i] > 0.0) roots[i] = std::sqrt(sums_[i] / counts_[i]);
    return roots;
  }

 private:
  std::vector<double> sums_, counts_;
};

}  // namespace

void rescaleBundle(double factor, Bundle* bundle) {
  for (FeatureState& feature : bundle->features) feature.inverse_depth /= factor;
  for (CameraState& camera : bundle->cameras) camera.position_world *= factor;
}

double chooseUnit(const BundleOptions& options, Bundle* bundle) {
  double sum = 0.0, squares = 0.0;
  for (const FeatureState& feature : bundle->features) {
    sum += feature.inverse_depth;
    squares += feature.inverse_depth * feature.inverse_depth;
  }
  const double before = depthCost(options, *bundle);
  if (sum > 0.0) rescaleBundle(squares / (options.inverse_depth * sum), bundle);
  return before - depthCost(options, *bundle);
}

double adjustBundle(const CameraModel& model, const BundleOptions& options, Bundle* bundle) {
  double damping = 1e-3;
  chooseUnit(options, bundle);
  NormalEquations N = linearise(model, options, *bundle);
  double cost = N.cost;
  Eigen::VectorXd camera_step, feature_steps;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    const std::vector<CameraState> cameras = bundle->cameras;
    const std::vector<FeatureState> features = bundle->features;
    const CalibrationVector calibration = bundle->calibration;
    double gain = 0.0;
    while (!(gain > 0.0) && damping < 1e8) {
      if (solveStep(N, damping, &camera_step, &feature_steps)) {
        applyStep(options, camera_step, feature_steps, bundle);
        gain = cost - bundleCost(model, options, *bundle);
        if (!(gain > 0.0)) {
          bundle->cameras = cameras;
          bundle->features = features;
          bundle->calibration = calibration;
        }
      }
      damping = gain > 0.0 ? std::max(0.1 * damping, 1e-9) : 10.0 * damping;
    }
    if (!(gain > 0.0)) break;
    gain += chooseUnit(options, bundle);
    cost -= gain;
    const int left = options.max_iterations - 1 - iteration;
    if (left == 0 || gain < options.least_gain * cost || cost - left * gain > options.hopeless_cost)
      break;
    N = linearise(model, options, *bundle);
  }
  return cost;
}

Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera,
                                 double relative_scale_sigma) {
  const NormalEquations N = linearise(model, options, bundle);
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
  // The unit is known as well as said: one more measurement.
  Eigen::VectorXd depths = Eigen::VectorXd::Zero(M.rows());
  for (int i = 0; i < F; ++i)
    depths[kept + 3 * i + 2] = 1.0 / (F * bundle.features[i].inverse_depth);
  const Eigen::VectorXd along = lower * depths;
  const double variance = depths.dot(along);
  lower.rankUpdate(along, -1.0 / (relative_scale_sigma * relative_scale_sigma + variance));
  covariance.triangularView<Eigen::StrictlyUpper>() = covariance.transpose();
  return covariance;
}

std::vector<double> featureErrors(const CameraModel& model, const Bundle& bundle) {
  MeanSquares errors(bundle.features.size());
  forEachMiss(model, bundle, [&](std::size_t, const BundleObservation& o, double squared_px) {
    errors.add(o.feature, squared_px, std::numeric_limits<double>::infinity());
  });
  return errors.roots();
}

std::vector<double> imageErrors(const CameraModel& model, const Bundle& bundle, double most_px) {
  MeanSquares errors(bundle.cameras.size());
  forEachMiss(model, bundle, [&](std::size_t k, const BundleObservation&, double squared_px) {
    errors.add(k, squared_px, most_px);
  });
  return errors.roots();
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

void reverseDepths(const CameraModel& model, Bundle* bundle) {
  constexpr double kLeastShare = 0.1;  // of the mean, that a mirrored inverse depth keeps
  double mean = 0.0;
  for (const FeatureState& feature : bundle->features) mean += feature.inverse_depth;
  mean /= static_cast<double>(std::max<std::size_t>(bundle->features.size(), 1));
  for (FeatureState& feature : bundle->features)
    feature.inverse_depth = std::max(2.0 * mean - feature.inverse_depth, kLeastShare * mean);
  for (std::size_t k = 1; k < bundle->cameras.size(); ++k) {
    bundle->cameras[k].position_world *= -1.0;
    alignRotation(model, static_cast<int>(k), bundle);
  }
}

}  // namespace active_matching_slam
