#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/feature_state.h"

namespace active_matching_slam {

/// An image point of a feature, by the feature's place in Bundle::features.
struct BundleObservation {
  int feature = -1;
  Eigen::Vector2d pixel;
  /// Derivative of the pixel by the calibration, in the order of CameraError from kReadout on.
  Eigen::Matrix<double, 2, CameraError::kCalibrationSize> d_calibration =
      Eigen::Matrix<double, 2, CameraError::kCalibrationSize>::Zero();
  double relative_sigma = 1.0;  ///< standard deviation over BundleOptions::sigma_px
  /// Inverse of FeatureMeasurement::noise_shape.
  Eigen::Matrix2d inverse_shape = Eigen::Matrix2d::Identity();
};

/// Cameras, features and calibration that are adjusted together. The first camera is held where it
/// is, at the world's origin, and every feature is anchored there (inverse depth,
/// FeatureState::anchored_at_origin).
struct Bundle {
  std::vector<CameraState> cameras;  ///< only their poses are read and changed
  std::vector<FeatureState> features;
  std::vector<std::vector<BundleObservation>> observations;  ///< one list a camera
  CalibrationVector calibration = CalibrationVector::Zero();
};

struct BundleOptions {
  double sigma_px = 0.45;          ///< standard deviation of an image point, per axis
  double minimum_sigma_px = 0.01;  ///< no estimate of it from residuals is less
  /// Scale of Cauchy's loss [sigma]: 95 % efficient for Gaussian noise (Holland and Welsch 1977).
  double loss_scale_sigmas = 2.3849;
  double inverse_depth = 1.0;  ///< prior mean of every inverse depth; it is the unit
  /// Standard deviation of that prior, weak: it only keeps finite what images leave open.
  double sigma_inverse_depth = 3.0;
  double minimum_inverse_depth = 1e-4;
  CalibrationVector sigma_calibration = CalibrationVector::Zero();  ///< prior, about zero
  bool rotation_only = false;  ///< all cameras stay at the origin
  int max_iterations = 20;
  double least_relative_decrease = 1e-3;  ///< of the cost, for another iteration
};

struct BundleFit {
  double cost = 0.0;  ///< minus twice the log posterior, up to a constant
  bool converged = false;
};

/// Takes all lengths times `factor`.
void rescaleBundle(double factor, Bundle* bundle);

/// Levenberg-Marquardt over all cameras but the first, the calibration, all bearings and inverse
/// depths, with the features eliminated first (Schur complement; Triggs et al. 1999, section 6.1)
/// and Cauchy's loss. After each step the scale is set to that which fits the prior of inverse
/// depths best, since steps creep along this gauge.
///
/// Own code rather than Ceres: the Schur complement is needed for the covariance anyway, the
/// problem has one kind of residual, and the result is the same bit for bit on every machine and
/// thread.
BundleFit adjustBundle(const CameraModel& model, const BundleOptions& options, Bundle* bundle);

/// First-order covariance at a minimum of the cameras from `first_camera` on (position and
/// rotation, 6 each, as in CameraError), of the calibration and then of all features (bearing and
/// inverse depth, 3 each): the inverse Fisher information of the image points and priors, with that
/// of the image points over `variance_inflation`, for errors that are correlated. The lens is a
/// consider parameter (Schmidt 1966): images teach nothing of it, it is as uncertain as its prior
/// and makes the rest so. The scale gauge: the mean relative change of the inverse depths, by
/// `scale_weights` (of sum 1), is known to `relative_scale_sigma`. Empty when singular.
Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera, double variance_inflation,
                                 const Eigen::VectorXd& scale_weights, double relative_scale_sigma);

/// Information on the logarithm of each inverse depth if the cameras were known.
Eigen::VectorXd depthInformation(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle);

/// Root mean square [px] per axis of the whitened reprojection errors of each feature, times
/// sigma_px; 0 for one without image points.
std::vector<double> featureErrors(const CameraModel& model, const Bundle& bundle);

/// Standard deviation [px] per axis of the image points, estimated from the reprojection errors at
/// a minimum: no feature counts for more than three times the median one, and the
/// parameters estimated are taken off the degrees of freedom.
double estimateSigma(const CameraModel& model, const Bundle& bundle);

/// Multiplies the sigmas of each image's points by what their reprojection errors show against
/// those of the median image: in one that is blurred all are worse (variance components; Foerstner
/// 1979). The first image, against which all are measured, counts as the median.
void estimateImageVariances(const CameraModel& model, Bundle* bundle);

/// Rotates camera `index` so that the observed rays fit the features as seen from its position
/// (Kabsch 1976).
void alignRotation(const CameraModel& model, int index, Bundle* bundle);

}  // namespace active_matching_slam
