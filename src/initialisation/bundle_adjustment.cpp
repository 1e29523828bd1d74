#include "active_matching_slam/initialisation/bundle_adjustment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/math/rotation.h"
#include "bundle_equations.h"

namespace active_matching_slam {
namespace {

double bundleCost(const CameraModel& model, const BundleOptions& options, const Bundle& bundle) {
  double cost =
      depthCost(options, bundle) +
      bundle.calibration.dot(calibrationInformation(options).cwiseProduct(bundle.calibration));
  forEachMiss(model, bundle, [&](std::size_t, const BundleObservation&, double squared_px) {
    cost += std::isfinite(squared_px) ? robustCost(options, squared_px) : kCostOfInvisible;
  });
  return cost;
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

void flatten(const CameraModel& model, double inverse_depth, Bundle* bundle) {
  for (FeatureState& feature : bundle->features) feature.inverse_depth = inverse_depth;
  for (std::size_t k = 1; k < bundle->cameras.size(); ++k) {
    bundle->cameras[k].position_world.setZero();
    alignRotation(model, static_cast<int>(k), bundle);
  }
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
