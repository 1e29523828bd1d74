#pragma once

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/filter/camera_state.h"

namespace active_matching_slam {

/// Standard deviations per axis of the accelerations that a constant velocity leaves out (eq. 3.6).
struct Accelerations {
  double linear_mps2 = 0.0;
  double angular_rps2 = 0.0;
};

/// Settings of the EKF. Units: m stands for the map unit when scale is free.
struct FilterOptions {
  double sigma_acceleration_mps2 = 7.0;           ///< widest expected, linear, per axis (eq. 3.6)
  double sigma_angular_acceleration_rps2 = 12.0;  ///< widest expected, angular, per axis
  double sigma_px = 0.45;                         ///< measurement noise, per axis
  /// Least noise of a match: what template matching reaches on natural images (Ackermann 1984).
  double minimum_sigma_px = 0.1;
  double noise_memory_s = 0.1;     ///< within which the noise of matches may change
  double motion_memory_s = 0.4;    ///< within which the camera's accelerations may change
  double landmark_noise_px = 0.2;  ///< process noise per axis and root of a radian; see Ekf
  double initial_sigma_velocity_mps = 0.5;
  double initial_sigma_angular_velocity_rps = 0.5;
  /// How far the calibration is trusted; what images tell corrects it. 0: beyond doubt.
  double initial_sigma_readout_s = 0.01;
  /// These: see LensCorrection. As bundle-adjusted calibrations of good practice are repeatable
  /// (.1 %, half a pixel of 500).
  double initial_sigma_focal = 0.001;
  double initial_sigma_radial = 0.002;
  double initial_sigma_centre = 0.001;
  /// The lens's three are so many times as large where no distortion was calibrated.
  double uncalibrated_factor = 5.0;
  double initial_inverse_depth = 1.0;        ///< rho_0 of a new feature [1/m]
  double initial_sigma_inverse_depth = 0.5;  ///< infinity within 2 sigma (Civera 2008)
  double linearity_threshold = 0.02;         ///< inverse depth -> point below (Civera 2008)
  double minimum_inverse_depth = 1e-4;       ///< mean is kept above [1/m]
  int update_iterations =
      1;  ///< linearisations of an update at most, 1 to 10; repeated when needed
};

/// Of the prior, in the order of CameraError from kReadout on.
CalibrationVector calibrationSigmas(const FilterOptions& options);

/// The options for a camera, by whether its lens was calibrated (hasDistortion()).
FilterOptions withTrustIn(const CameraCalibration& calibration, FilterOptions options);

/// Throws std::invalid_argument with name, value and allowed range.
void checkFilterOptions(const FilterOptions& options);

}  // namespace active_matching_slam
