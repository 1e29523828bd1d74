#include "active_matching_slam/filter/filter_options.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {
namespace {

TEST(FilterOptions, DefaultsAreAccepted) { EXPECT_NO_THROW(Ekf{FilterOptions()}); }

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

TEST(FilterOptions, ALensTrustedLessIsWithinWhatAFilterAccepts) {
  FilterOptions options;
  options.initial_sigma_focal = 0.15;
  options.uncalibrated_factor = 100.0;
  const FilterOptions less = withTrustIn(CameraCalibration(), options);
  EXPECT_NO_THROW(Ekf{less});
  EXPECT_GT(less.initial_sigma_focal, options.initial_sigma_focal);
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
