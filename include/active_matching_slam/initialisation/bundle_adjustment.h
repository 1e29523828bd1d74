#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/feature_state.h"

namespace active_matching_slam {

/// An image point of a feature, by the feature's place in Bundle::features.
struct BundleObservation {
  int feature = -1;
  Eigen::Vector2d pixel;
  /// How the pixel answers to the calibration, in the order of CameraError from kReadout on.
  Eigen::Matrix<double, 2, CameraError::kCalibrationSize> d_calibration =
      Eigen::Matrix<double, 2, CameraError::kCalibrationSize>::Zero();
  double noise = 1.0;  ///< standard deviation, in BundleOptions::sigma_px
  /// Inverse of FeatureMeasurement::noise_shape.
  Eigen::Matrix2d inverse_shape = Eigen::Matrix2d::Identity();
};

/// Cameras, features and calibration to be adjusted together. The first camera is the world: it
/// stays at the origin, and every feature is anchored there (inverse depth,
/// FeatureState::anchored_at_origin).
struct Bundle {
  std::vector<CameraState> cameras;  ///< of all but the pose nothing is read or changed
  std::vector<FeatureState> features;
  std::vector<std::vector<BundleObservation>> observations;  ///< one list a camera
  CalibrationVector calibration = CalibrationVector::Zero();
};

struct BundleOptions {
  double sigma_px = 0.45;            ///< of an image point, per axis
  double outlier_px = 1.25;          ///< image points much further off count for little
  double inverse_depth = 1.0;        ///< prior mean of every inverse depth; it sets the scale
  double sigma_inverse_depth = 0.5;  ///< and its standard deviation
  double minimum_inverse_depth = 1e-4;
  CalibrationVector sigma_calibration = CalibrationVector::Zero();  ///< prior, about zero
  /// Whether bundleCovariance() is as large as what the features show, whatever `sigma_px`.
  bool scale_by_scatter = false;
  int max_iterations = 20;
  double least_gain = 1e-4;  ///< relative fall of the cost that is worth a step more
  /// Ends where steps like the last, as many as are left, would not bring the cost below.
  double hopeless_cost = std::numeric_limits<double>::infinity();
};

/// Takes all lengths times `factor`.
void rescaleBundle(double factor, Bundle* bundle);

/// Takes the unit of length that fits the prior of inverse depths best: images look the same in
/// any. Returns by how much the cost falls.
double chooseUnit(const BundleOptions& options, Bundle* bundle);

/// Levenberg-Marquardt over all cameras but the first, the calibration, all bearings and inverse
/// depths, the features eliminated first (Triggs et al. 1999, section 6.1), image points weighted
/// by Cauchy's function, the unit chosen anew after each step, since steps creep along it. Returns
/// the cost reached: minus twice the logarithm of the posterior, up to a constant.
double adjustBundle(const CameraModel& model, const BundleOptions& options, Bundle* bundle);

/// Covariance at a minimum, first order, of the cameras from `first_camera` on (position and
/// rotation, 6 each, as in CameraError), of the calibration and then of all features (bearing and
/// inverse depth, 3 each). Of the lens nothing is learnt: it is as uncertain as before and makes
/// the rest so (a consider parameter; Schmidt 1966). With `scale_by_scatter` the noise of image
/// points is what makes the last camera as uncertain as features and what they miss show: each is a
/// cluster, in which errors may last from image to image (Bell and McCaffrey 2002; Cameron and
/// Miller 2015, A Practitioner's Guide to Cluster-Robust Inference). The unit of
/// length is that in which the mean logarithm of the inverse depths, weighted by `unit_shares` (of
/// sum 1), is what it is, to `relative_scale_sigma`.
Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera,
                                 const Eigen::VectorXd& unit_shares, double relative_scale_sigma);

/// What each feature tells of the logarithm of the unit of length, if the cameras were known:
/// shares of 1.
Eigen::VectorXd depthShares(const CameraModel& model, const BundleOptions& options,
                            const Bundle& bundle);

/// Root mean square [px], per axis, of what image points miss of each feature's projections, over
/// their noise in that of most.
std::vector<double> featureErrors(const CameraModel& model, const Bundle& bundle);

/// The same by images. No point counts for more than `most_px`; zero where there is none.
std::vector<double> imageErrors(const CameraModel& model, const Bundle& bundle, double most_px);

/// The reading of the same images by a camera that only turned, past features all at one depth.
void flatten(const CameraModel& model, double inverse_depth, Bundle* bundle);

/// The reading of the same images with near and far exchanged, which a narrow view or little
/// parallax can hardly tell from the first (the bas-relief ambiguity; Belhumeur et al. 1999):
/// inverse depths mirrored at their mean, the camera's path reversed, turned to fit.
void reverseDepths(const CameraModel& model, Bundle* bundle);

/// Turns camera `index` so that the observed rays fit the features as seen from its place.
void alignRotation(const CameraModel& model, int index, Bundle* bundle);

}  // namespace active_matching_slam
