#include "active_matching_slam/filter/filter_options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {
namespace {

std::string faultOf(const FilterOptions& options) {
  try {
    checkFilterOptions(options);
  } catch (const std::invalid_argument& fault) {
    return fault.what();
  }
  return "";
}

struct DoubleOption {
  const char* name;
  double FilterOptions::*member;
  bool zero_allowed;
};

const DoubleOption kOptions[] = {
    {"sigma_acceleration_mps2", &FilterOptions::sigma_acceleration_mps2, true},
    {"sigma_angular_acceleration_rps2", &FilterOptions::sigma_angular_acceleration_rps2, true},
    {"sigma_px", &FilterOptions::sigma_px, false},
    {"minimum_sigma_px", &FilterOptions::minimum_sigma_px, false},
    {"noise_memory_s", &FilterOptions::noise_memory_s, false},
    {"motion_memory_s", &FilterOptions::motion_memory_s, false},
    {"landmark_noise_px", &FilterOptions::landmark_noise_px, true},
    {"initial_sigma_velocity_mps", &FilterOptions::initial_sigma_velocity_mps, true},
    {"initial_sigma_angular_velocity_rps", &FilterOptions::initial_sigma_angular_velocity_rps,
     true},
    {"initial_sigma_readout_s", &FilterOptions::initial_sigma_readout_s, true},
    {"initial_sigma_focal", &FilterOptions::initial_sigma_focal, true},
    {"initial_sigma_radial", &FilterOptions::initial_sigma_radial, true},
    {"initial_sigma_centre", &FilterOptions::initial_sigma_centre, true},
    {"uncalibrated_factor", &FilterOptions::uncalibrated_factor, false},
    {"initial_inverse_depth", &FilterOptions::initial_inverse_depth, false},
    {"initial_sigma_inverse_depth", &FilterOptions::initial_sigma_inverse_depth, false},
    {"linearity_threshold", &FilterOptions::linearity_threshold, true},
    {"minimum_inverse_depth", &FilterOptions::minimum_inverse_depth, false},
};

TEST(FilterOptions, DefaultsAreAccepted) { EXPECT_EQ(faultOf(FilterOptions()), ""); }

TEST(FilterOptions, EveryValueOutOfRangeIsRefusedByName) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const DoubleOption& option : kOptions) {
    for (const double bad : {-1.0, std::nan(""), infinity, -infinity}) {
      FilterOptions options;
      options.*option.member = bad;
      EXPECT_NE(faultOf(options).find(option.name), std::string::npos) << option.name << bad;
    }
    FilterOptions options;
    options.*option.member = 0.0;
    EXPECT_EQ(faultOf(options).empty(), option.zero_allowed) << option.name;
  }
  for (const int bad : {-1, 0, 11}) {
    FilterOptions options;
    options.update_iterations = bad;
    EXPECT_NE(faultOf(options).find("update_iterations"), std::string::npos);
  }
}

TEST(FilterOptions, ALensThatNobodyCalibratedIsTrustedLess) {
  FilterOptions options;
  options.uncalibrated_factor = 3.0;
  CameraCalibration calibration;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {0.0, 0.0, 0.0, 1e-4, 0.0};
  EXPECT_EQ(calibrationSigmas(withTrustIn(calibration, options)), calibrationSigmas(options));
  CalibrationVector expected = calibrationSigmas(options);
  expected.tail<4>() *= 3.0;  // not the readout
  for (const std::vector<double>& none : {std::vector<double>{}, std::vector<double>(5, 0.0)}) {
    calibration.distortion = none;
    EXPECT_TRUE(calibrationSigmas(withTrustIn(calibration, options)).isApprox(expected));
  }
}

TEST(FilterOptions, AFilterRefusesBadOptionsAndKeepsTheOld) {
  FilterOptions bad;
  bad.sigma_px = 0.0;
  EXPECT_THROW(Ekf{bad}, std::invalid_argument);
  Ekf filter{FilterOptions()};
  EXPECT_THROW(filter.setOptions(bad), std::invalid_argument);
  EXPECT_EQ(filter.options().sigma_px, FilterOptions().sigma_px);
}

}  // namespace
}  // namespace active_matching_slam
