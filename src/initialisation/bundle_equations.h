#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

constexpr int kCalibrationSize = CameraError::kCalibrationSize;
constexpr int kLensSize = kCalibrationSize - 1;  ///< all but the readout
using LensVector = Eigen::Matrix<double, kLensSize, 1>;

/// Cost of an image point whose feature does not project.
constexpr double kCostOfInvisible = 1e3;

/// A symmetric matrix over C numbers of the cameras (but the first, 6 each, and of the calibration)
/// and 3 of each of F features, of which no two have anything in common.
struct BundleMatrix {
  Eigen::MatrixXd cameras;                ///< C x C, lower triangle
  std::vector<Eigen::Matrix3d> features;  ///< F blocks
  Eigen::MatrixXd cross;                  ///< C x 3F
};

/// Least squares about the present state: the information, with C = 6K + kCalibrationSize.
struct NormalEquations : BundleMatrix {
  double cost = 0.0;
  Eigen::VectorXd camera_gradient;   ///< C
  Eigen::VectorXd feature_gradient;  ///< 3F
};

NormalEquations linearise(const CameraModel& model, const BundleOptions& options,
                          const Bundle& bundle);

/// The normal equations of the cameras alone, once the features are eliminated.
struct CameraEquations {
  Eigen::LLT<Eigen::MatrixXd> factor;          ///< C x C
  Eigen::MatrixXd cross;                       ///< W L^-T, where H = L L^T is a feature's block
  std::vector<Eigen::Matrix3d> inverse_roots;  ///< L^-1 of each feature
};

/// With the diagonal grown by `damping`. Empty when not positive definite. Given
/// `lens_information`, that is all that is known of the lens once the rest is eliminated.
std::optional<CameraEquations> eliminateFeatures(const BundleMatrix& information, double damping,
                                                 const LensVector* lens_information = nullptr);

/// Combinations of what the normal equations have of the cameras and of the readout.
constexpr int kLastPoseSize = 5;
using LastPoseMap = Eigen::Matrix<double, kLastPoseSize, Eigen::Dynamic>;

/// What the image points of one feature say, once it is eliminated, of such combinations.
struct FeaturePull {
  Eigen::Matrix<double, kLastPoseSize, 1> gradient =
      Eigen::Matrix<double, kLastPoseSize, 1>::Zero();
  Eigen::Matrix<double, kLastPoseSize, kLastPoseSize> information =
      Eigen::Matrix<double, kLastPoseSize, kLastPoseSize>::Zero();
};

struct FeaturePulls {
  std::vector<FeaturePull> features;
  /// By how much more a minimum yields than the information says: the slope of a robust function
  /// falls below its weight.
  double yielding = 1.0;
  /// Variance of what image points miss, in what is said, per degree of freedom.
  double missed = 0.0;
};

/// Through `map`, 5 x (6K + 1).
FeaturePulls pullsOfFeatures(const CameraModel& model, const BundleOptions& options,
                             const Bundle& bundle, const NormalEquations& N,
                             const CameraEquations& reduced, const LastPoseMap& map);

/// Inverse variances of the prior.
CalibrationVector calibrationInformation(const BundleOptions& options);

/// Of the inverse depths by their prior.
double depthCost(const BundleOptions& options, const Bundle& bundle);

/// Cauchy's function of a squared miss [px^2], in units of the noise: what is far off counts ever
/// less.
double robustCost(const BundleOptions& options, double squared);

/// Where a point would be seen by the calibration as given.
inline Eigen::Vector2d plainPixel(const Bundle& bundle, const BundleObservation& o) {
  return o.pixel - o.d_calibration * bundle.calibration;
}

/// Of a residual [px], squared, as if the point were as noisy as most, and so along both axes.
inline double squaredMiss(const BundleObservation& o, const Eigen::Vector2d& residual_px) {
  return residual_px.dot(o.inverse_shape * residual_px) / (o.noise * o.noise);
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

}  // namespace active_matching_slam
