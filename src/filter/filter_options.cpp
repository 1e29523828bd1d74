#include "active_matching_slam/filter/filter_options.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

namespace active_matching_slam {
namespace {

void check(bool ok, const std::string& name, double value, const std::string& range) {
  if (ok) return;
  std::ostringstream message;
  message << "filter option " << name << " = " << value << " is outside " << range;
  throw std::invalid_argument(message.str());
}

void checkPositive(const std::string& name, double value) {
  check(std::isfinite(value) && value > 0.0, name, value, "(0, inf)");
}

void checkNotNegative(const std::string& name, double value) {
  check(std::isfinite(value) && value >= 0.0, name, value, "[0, inf)");
}

}  // namespace

CalibrationVector calibrationSigmas(const FilterOptions& options) {
  CalibrationVector sigmas;
  sigmas << options.initial_sigma_readout_s, options.initial_sigma_focal,
      options.initial_sigma_radial, Eigen::Vector2d::Constant(options.initial_sigma_centre);
  return sigmas;
}

FilterOptions withTrustIn(const CameraCalibration& calibration, FilterOptions options) {
  if (hasDistortion(calibration)) return options;
  for (double* sigma :
       {&options.initial_sigma_focal, &options.initial_sigma_radial, &options.initial_sigma_centre})
    *sigma *= options.uncalibrated_factor;
  return options;
}

void checkFilterOptions(const FilterOptions& options) {
  checkNotNegative("sigma_acceleration_mps2", options.sigma_acceleration_mps2);
  checkNotNegative("sigma_angular_acceleration_rps2", options.sigma_angular_acceleration_rps2);
  checkPositive("sigma_px", options.sigma_px);
  checkPositive("minimum_sigma_px", options.minimum_sigma_px);
  checkPositive("noise_memory_s", options.noise_memory_s);
  checkPositive("motion_memory_s", options.motion_memory_s);
  checkNotNegative("landmark_noise_px", options.landmark_noise_px);
  checkNotNegative("initial_sigma_velocity_mps", options.initial_sigma_velocity_mps);
  checkNotNegative("initial_sigma_angular_velocity_rps",
                   options.initial_sigma_angular_velocity_rps);
  checkNotNegative("initial_sigma_readout_s", options.initial_sigma_readout_s);
  checkNotNegative("initial_sigma_focal", options.initial_sigma_focal);
  checkNotNegative("initial_sigma_radial", options.initial_sigma_radial);
  checkNotNegative("initial_sigma_centre", options.initial_sigma_centre);
  checkPositive("uncalibrated_factor", options.uncalibrated_factor);
  checkPositive("initial_inverse_depth", options.initial_inverse_depth);
  checkPositive("initial_sigma_inverse_depth", options.initial_sigma_inverse_depth);
  checkNotNegative("linearity_threshold", options.linearity_threshold);
  checkPositive("minimum_inverse_depth", options.minimum_inverse_depth);
  check(options.update_iterations >= 1 && options.update_iterations <= 10, "update_iterations",
        options.update_iterations, "[1, 10]");
}

}  // namespace active_matching_slam
