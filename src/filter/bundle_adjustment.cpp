#include "active_matching_slam/filter/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/rotation.h"

namespace active_matching_slam {
namespace {

constexpr double kCostOfInvisible = 1e3;  ///< of an image point whose feature does not project
constexpr double kLeastGain = 1e-4;       ///< relative fall of the cost that is worth a step more

using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

/// Least squares over (cameras but the first, 6 each; features, 3 each) about the present state.
struct NormalEquations {
  double cost = 0.0;
  Eigen::MatrixXd cameras;                         ///< 6K x 6K, block diagonal
  Eigen::VectorXd camera_gradient;                 ///< 6K
  std::vector<Eigen::Matrix3d> features;           ///< F blocks
  std::vector<Eigen::Vector3d> feature_gradients;  ///< F
  struct Cross {
    int camera;  ///< less the first
    Eigen::Matrix<double, 6, 3> block;
  };
  std::vector<std::vector<Cross>> cross;  ///< by feature
};

/// Cauchy's function of a squared residual [px^2], in units of the noise: what is far off counts
/// ever less.
double robustCost(const BundleOptions& options, double squared) {
  const double limit = options.outlier_px * options.outlier_px;
  return limit * std::log1p(squared / limit) / (options.sigma_px * options.sigma_px);
}

/// Information [1/px^2] of an image point with that residual.
double robustInformation(const BundleOptions& options, double squared) {
  return 1.0 / (options.sigma_px * options.sigma_px) /
         (1.0 + squared / (options.outlier_px * options.outlier_px));
}

double bundleCost(const CameraModel& model, const BundleOptions& options, const Bundle& bundle) {
  double cost = 0.0;
  for (const FeatureState& feature : bundle.features)
    cost +=
        std::pow((feature.inverse_depth - options.inverse_depth) / options.sigma_inverse_depth, 2);
  for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
    const CameraState& camera = bundle.cameras[k];
    const Eigen::Matrix3d R_camera_world = camera.q_world_camera.toRotationMatrix().transpose();
    for (const BundleObservation& o : bundle.observations[k]) {
      const FeatureState& feature = bundle.features[o.feature];
      const auto pixel = model.project(
          R_camera_world * (feature.bearing_world - feature.inverse_depth * camera.position_world));
      cost += pixel ? robustCost(options, (o.pixel - *pixel).squaredNorm()) : kCostOfInvisible;
    }
  }
  return cost;
}

NormalEquations linearise(const CameraModel& model, const BundleOptions& options,
                          const Bundle& bundle) {
  const int K = static_cast<int>(bundle.cameras.size()) - 1;
  const std::size_t F = bundle.features.size();
  NormalEquations N;
  N.cameras = Eigen::MatrixXd::Zero(6 * K, 6 * K);
  N.camera_gradient = Eigen::VectorXd::Zero(6 * K);
  N.features.assign(F, Eigen::Matrix3d::Zero());
  N.feature_gradients.assign(F, Eigen::Vector3d::Zero());
  N.cross.resize(F);
  for (std::size_t i = 0; i < F; ++i) {
    const double weight = 1.0 / (options.sigma_inverse_depth * options.sigma_inverse_depth);
    const double error = options.inverse_depth - bundle.features[i].inverse_depth;
    N.features[i](2, 2) += weight;
    N.feature_gradients[i][2] += weight * error;
    N.cost += weight * error * error;
  }
  for (int k = 0; k <= K; ++k) {
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto projection = projectFeature(model, bundle.cameras[k], bundle.features[o.feature]);
      if (!projection) {
        N.cost += kCostOfInvisible;
        continue;
      }
      const Eigen::Vector2d residual = o.pixel - projection->pixel;
      const double weight = robustInformation(options, residual.squaredNorm());
      N.cost += robustCost(options, residual.squaredNorm());
      const Matrix23 J = projection->d_feature.rightCols<3>();
      N.features[o.feature] += weight * J.transpose() * J;
      N.feature_gradients[o.feature] += weight * J.transpose() * residual;
      if (k == 0) continue;
      const Matrix26& C = projection->d_camera;
      N.cameras.block<6, 6>(6 * (k - 1), 6 * (k - 1)) += weight * C.transpose() * C;
      N.camera_gradient.segment<6>(6 * (k - 1)) += weight * C.transpose() * residual;
      N.cross[o.feature].push_back({k - 1, weight * C.transpose() * J});
    }
  }
  return N;
}

/// Solves for the step with the diagonal grown by `damping`. False when not positive definite.
bool solveStep(const NormalEquations& N, double damping, Eigen::VectorXd* cameras,
               std::vector<Eigen::Vector3d>* features) {
  Eigen::MatrixXd S = N.cameras;
  S.diagonal() *= 1.0 + damping;
  Eigen::VectorXd g = N.camera_gradient;
  std::vector<Eigen::Matrix3d> inverses(N.features.size());
  for (std::size_t i = 0; i < N.features.size(); ++i) {
    Eigen::Matrix3d H = N.features[i];
    H.diagonal() *= 1.0 + damping;
    inverses[i] = H.inverse();
    if (!inverses[i].allFinite()) return false;
    for (const auto& a : N.cross[i]) {
      const Eigen::Matrix<double, 6, 3> reduced = a.block * inverses[i];
      g.segment<6>(6 * a.camera) -= reduced * N.feature_gradients[i];
      for (const auto& b : N.cross[i])
        if (b.camera <= a.camera)
          S.block<6, 6>(6 * a.camera, 6 * b.camera) -= reduced.lazyProduct(b.block.transpose());
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(S);  // reads the lower triangle
  if (factor.info() != Eigen::Success) return false;
  *cameras = factor.solve(g);
  features->resize(N.features.size());
  for (std::size_t i = 0; i < N.features.size(); ++i) {
    Eigen::Vector3d gradient = N.feature_gradients[i];
    for (const auto& a : N.cross[i])
      gradient -= a.block.transpose() * cameras->segment<6>(6 * a.camera);
    (*features)[i] = inverses[i] * gradient;
  }
  return cameras->allFinite();
}

void applyStep(const BundleOptions& options, const Eigen::VectorXd& cameras,
               const std::vector<Eigen::Vector3d>& features, Bundle* bundle) {
  for (std::size_t k = 1; k < bundle->cameras.size(); ++k) {
    CameraState& camera = bundle->cameras[k];
    const auto step = cameras.segment<6>(6 * static_cast<Eigen::Index>(k - 1));
    camera.position_world += step.head<3>();
    camera.q_world_camera =
        (rotationFromVector(step.tail<3>()) * camera.q_world_camera).normalized();
  }
  for (std::size_t i = 0; i < features.size(); ++i) {
    FeatureState& feature = bundle->features[i];
    const Eigen::Vector3d direction = feature.tangentBasis() * features[i].head<2>();
    const Eigen::Quaterniond turn = rotationFromVector(feature.bearing_world.cross(direction));
    feature.bearing_world = (turn * feature.bearing_world).normalized();
    const Eigen::Vector3d tangent = turn * feature.tangent_world;
    feature.tangent_world =
        (tangent - feature.bearing_world * feature.bearing_world.dot(tangent)).normalized();
    feature.inverse_depth =
        std::max(feature.inverse_depth + features[i][2], options.minimum_inverse_depth);
  }
}

}  // namespace

double adjustBundle(const CameraModel& model, const BundleOptions& options, Bundle* bundle) {
  double damping = 1e-3;
  NormalEquations N = linearise(model, options, *bundle);
  Eigen::VectorXd camera_step;
  std::vector<Eigen::Vector3d> feature_steps;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    double cost = N.cost;
    Bundle trial;
    bool fell = false;
    while (!fell && damping < 1e8) {
      if (solveStep(N, damping, &camera_step, &feature_steps)) {
        trial = *bundle;
        applyStep(options, camera_step, feature_steps, &trial);
        cost = bundleCost(model, options, trial);
        fell = cost < N.cost;
      }
      damping = fell ? std::max(0.1 * damping, 1e-9) : 10.0 * damping;
    }
    if (!fell) break;
    *bundle = std::move(trial);
    const double gain = N.cost - cost;
    N = linearise(model, options, *bundle);
    if (gain < kLeastGain * N.cost) break;
  }
  return N.cost;
}

Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera,
                                 double relative_scale_sigma) {
  const NormalEquations N = linearise(model, options, bundle);
  const int cameras = static_cast<int>(N.cameras.rows());
  const int F = static_cast<int>(N.features.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(cameras + 3 * F, cameras + 3 * F);
  information.topLeftCorner(cameras, cameras) = N.cameras;
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(cameras + 3 * F);
  for (int i = 0; i < F; ++i) {
    const int o = cameras + 3 * i;
    information.block<3, 3>(o, o) = N.features[i];
    for (const auto& c : N.cross[i]) information.block<3, 6>(o, 6 * c.camera) = c.block.transpose();
    scale[o + 2] = 1.0 / (F * bundle.features[i].inverse_depth);
  }
  information += scale * scale.transpose() / (relative_scale_sigma * relative_scale_sigma);
  information.triangularView<Eigen::StrictlyUpper>() = information.transpose();
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  const int kept = cameras + 3 * F - 6 * (first_camera - 1);
  if (factor.info() != Eigen::Success) return {};
  Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(cameras + 3 * F, kept);
  selection.bottomRows(kept).setIdentity();
  factor.matrixL().solveInPlace(selection);
  return selection.transpose() * selection;
}

std::vector<double> featureErrors(const CameraModel& model, const Bundle& bundle) {
  std::vector<double> squares(bundle.features.size(), 0.0), counts(bundle.features.size(), 0.0);
  for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
    for (const BundleObservation& o : bundle.observations[k]) {
      const auto projection = projectFeature(model, bundle.cameras[k], bundle.features[o.feature]);
      if (!projection) continue;
      squares[o.feature] += 0.5 * (o.pixel - projection->pixel).squaredNorm();
      counts[o.feature] += 1.0;
    }
  }
  for (std::size_t i = 0; i < squares.size(); ++i)
    squares[i] = counts[i] > 0.0 ? std::sqrt(squares[i] / counts[i]) : 0.0;
  return squares;
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
