#pragma once

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/math/option_field.h"

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
  /// Derivation: a focal length of nothing stays 5 sigma away.
  static constexpr double kLargestSigmaLens = 0.2;
  /// The lens's three are so many times as large where no distortion was calibrated.
  double uncalibrated_factor = 5.0;
  double initial_inverse_depth = 1.0;        ///< rho_0 of a new feature [1/m]
  double initial_sigma_inverse_depth = 0.5;  ///< infinity within 2 sigma (Civera 2008)
  double linearity_threshold = 0.02;         ///< inverse depth -> point below (Civera 2008)
  double minimum_inverse_depth = 1e-4;       ///< mean is kept above [1/m]
  int update_iterations = 1;                 ///< linearisations of an update at most

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void FilterOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("filter/sigma_acceleration_mps2", "m/s^2",
                    "widest linear acceleration that is expected, standard deviation per axis"),
        o.sigma_acceleration_mps2, 1e-3, 1e3);
  visit(basicOption("filter/sigma_angular_acceleration_rps2", "rad/s^2",
                    "the same, angular acceleration"),
        o.sigma_angular_acceleration_rps2, 1e-3, 1e3);
  visit(basicOption("filter/sigma_px", "px",
                    "noise of a match before any is learnt, and where its template's fit does not "
                    "converge, per axis"),
        o.sigma_px, 0.05, 20.0);
  visit(basicOption("filter/minimum_sigma_px", "px",
                    "least noise that a match is taken to have, whatever residuals show"),
        o.minimum_sigma_px, 0.01, 20.0);
  visit(basicOption("filter/landmark_noise_px", "px",
                    "process noise of a landmark as the view of it turns, per axis and root of "
                    "a radian"),
        o.landmark_noise_px, 0.0, 20.0);
  visit(basicOption("filter/initial_sigma_readout_s", "s",
                    "trust in a global shutter: of the time from first row to last"),
        o.initial_sigma_readout_s, 0.0, 0.1);
  visit(basicOption("filter/initial_sigma_focal", "",
                    "trust in the calibration: of the focal length, relative"),
        o.initial_sigma_focal, 0.0, kLargestSigmaLens);
  visit(basicOption("filter/initial_sigma_radial", "",
                    "trust in the calibration: of radial distortion at 45 degrees, relative"),
        o.initial_sigma_radial, 0.0, kLargestSigmaLens);
  visit(
      basicOption("filter/initial_sigma_centre", "",
                  "trust in the calibration: of the image centre, per axis, relative to the focal "
                  "length"),
      o.initial_sigma_centre, 0.0, kLargestSigmaLens);
  visit(basicOption("filter/uncalibrated_factor", "",
                    "of the three before this, where camera_info has no distortion; 1 for "
                    "rectified images"),
        o.uncalibrated_factor, 1.0, 100.0);
  visit(basicOption("filter/initial_inverse_depth", "1/m",
                    "first guess of a new feature's inverse depth; fixes the map unit when the "
                    "scale is free"),
        o.initial_inverse_depth, 1e-3, 1e3);
  visit(advancedOption("filter/initial_sigma_inverse_depth", "1/m",
                       "its standard deviation; half the mean puts infinity at 2 sigma"),
        o.initial_sigma_inverse_depth, 1e-3, 1e3);
  visit(advancedOption("filter/noise_memory_s", "s",
                       "time within which the noise of matches may change"),
        o.noise_memory_s, 1e-3, 1e3);
  visit(advancedOption("filter/motion_memory_s", "s",
                       "time within which the camera's accelerations may change"),
        o.motion_memory_s, 1e-3, 1e3);
  visit(advancedOption("filter/initial_sigma_velocity_mps", "m/s",
                       "how fast the camera may go at the start, standard deviation per axis"),
        o.initial_sigma_velocity_mps, 1e-3, 100.0);
  visit(advancedOption("filter/initial_sigma_angular_velocity_rps", "rad/s",
                       "how fast it may turn at the start, standard deviation per axis"),
        o.initial_sigma_angular_velocity_rps, 1e-3, 100.0);
  visit(advancedOption("filter/linearity_threshold", "",
                       "a feature becomes a point of three coordinates when its depth is known so "
                       "well that the measurement bends less than this"),
        o.linearity_threshold, 0.0, 10.0);
  visit(advancedOption("filter/minimum_inverse_depth", "1/m",
                       "inverse depths are kept above: nothing is farther than its reciprocal"),
        o.minimum_inverse_depth, 1e-9, 1.0);
  visit(advancedOption("filter/update_iterations", "", "Gauss-Newton steps of an update, at most"),
        o.update_iterations, 1, 10);
}

/// Of the prior, in the order of CameraError from kReadout on.
CalibrationVector calibrationSigmas(const FilterOptions& options);

/// The options for a camera, by whether its lens was calibrated (hasDistortion()).
FilterOptions withTrustIn(const CameraCalibration& calibration, FilterOptions options);

}  // namespace active_matching_slam
