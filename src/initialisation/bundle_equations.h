#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

constexpr int kCalibrationSize = CameraError::kCalibrationSize;
constexpr int kLensSize = kCalibrationSize - 1;  ///< all but the readout
using LensVector = Eigen::Matrix<double, kLensSize, 1>;

/// Normal equations about the present state. C = 6 a camera but the first, and the calibration; of
/// F features no two have anything in common.
struct NormalEquations {
  double cost = 0.0;
  Eigen::MatrixXd cameras;                ///< C x C, lower triangle
  std::vector<Eigen::Matrix3d> features;  ///< F blocks
  Eigen::MatrixXd cross;                  ///< C x 3F
  Eigen::VectorXd camera_gradient;        ///< C
  Eigen::VectorXd feature_gradient;       ///< 3F
};

NormalEquations linearise(const CameraModel& model, const BundleOptions& options,
                          const Bundle& bundle);

double bundleCost(const CameraModel& model, const BundleOptions& options, const Bundle& bundle);

/// The normal equations of the cameras alone, once the features are eliminated.
struct ReducedEquations {
  Eigen::LLT<Eigen::MatrixXd> factor;          ///< C x C
  Eigen::MatrixXd cross;                       ///< W L^-T, where H = L L^T is a feature's block
  std::vector<Eigen::Matrix3d> inverse_roots;  ///< L^-1 of each feature
};

/// With the diagonal times 1 + `damping`. Empty when not positive definite. Given
/// `lens_information`, that is all that is known of the lens once the rest is eliminated.
std::optional<ReducedEquations> eliminateFeatures(const NormalEquations& equations, double damping,
                                                  const LensVector* lens_information = nullptr);

/// Inverse variances of the calibration's prior.
CalibrationVector calibrationInformation(const BundleOptions& options);

/// Cost of the inverse depths by their prior.
double depthCost(const BundleOptions& options, const Bundle& bundle);

/// Of a reprojection error, squared, as if its image point had sigma_px and were isotropic [px^2].
inline double whitenedSquare(const BundleObservation& o, const Eigen::Vector2d& residual_px) {
  return residual_px.dot(o.inverse_shape * residual_px) / (o.relative_sigma * o.relative_sigma);
}

/// The image point with the calibration's correction taken off.
inline Eigen::Vector2d correctedPixel(const Bundle& bundle, const BundleObservation& o) {
  return o.pixel - o.d_calibration * bundle.calibration;
}

/// Calls visit(image, observation, whitenedSquare) for all image points; infinite where the feature
/// does not project.
template <typename Visit>
void forEachResidual(const CameraModel& model, const Bundle& bundle, const Visit& visit) {
  for (std::size_t k = 0; k < bundle.cameras.size(); ++k) {
    const CameraState& camera = bundle.cameras[k];
    const Eigen::Matrix3d R_camera_world = camera.q_world_camera.toRotationMatrix().transpose();
    for (const BundleObservation& o : bundle.observations[k]) {
      const FeatureState& feature = bundle.features[o.feature];
      const auto pixel = model.project(
          R_camera_world * (feature.bearing_world - feature.inverse_depth * camera.position_world));
      visit(k, o,
            pixel ? whitenedSquare(o, correctedPixel(bundle, o) - *pixel)
                  : std::numeric_limits<double>::infinity());
    }
  }
}

}  // namespace active_matching_slam
