#include "active_matching_slam/filter/filter_options.h"

#include <algorithm>

namespace active_matching_slam {

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
    *sigma =
        std::clamp(*sigma * options.uncalibrated_factor, *sigma, FilterOptions::kLargestSigmaLens);
  return options;
}

}  // namespace active_matching_slam
