#include "active_matching_slam/tracker/tracking_quality.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

/// Time constant of the averages, and the time before which nothing is said [s]. Cost: the delay.
constexpr double kMemoryS = 1.0;
/// Logistic regression: log odds of a right model, by the fraction of features searched that did
/// not match and by the logarithm of the variance factor. Learnt: on four recordings, each with its
/// calibration and with five wrong ones, of equal weight; judged on three others (see the page).
constexpr double kIntercept = 5.59, kOfUnmatched = -6.30, kOfLogFactor = -1.59;
/// Quality below which a cause is named. Cost: false alarms; at this one, in less than 5 % of the
/// images of each of the seven recordings with its right calibration.
constexpr double kDoubt = 0.3;
/// Corrections of the calibration of more standard deviations of its prior are named as its cause.
/// Derivation: a Gaussian's are so large once in 1.7e6.
constexpr double kCalibrationSigmas = 5.0;
/// Fraction of the features with a match that was not accepted, from which on the scene is named.
/// Cost: which of two causes is named first.
constexpr double kManyRejected = 0.2;

/// Largest correction, in standard deviations of its prior.
double calibrationSigmasOff(const CameraState& camera, const FilterOptions& options) {
  const auto off = [](double value, double sigma) { return sigma > 0.0 ? value / sigma : 0.0; };
  return std::max({std::abs(off(camera.lens.focal, options.initial_sigma_focal)),
                   std::abs(off(camera.lens.radial, options.initial_sigma_radial)),
                   off(camera.lens.centre.norm(), options.initial_sigma_centre)});
}

}  // namespace

void TrackingQuality::add(double interval_s, const QualitySigns& signs, const CameraState& camera,
                          const FilterOptions& options) {
  if (signs.predicted == 0 || !(interval_s > 0.0) || !(signs.variance_factor > 0.0)) return;
  seconds_ += interval_s;
  const double weight = std::max(interval_s / seconds_, 1.0 - std::exp(-interval_s / kMemoryS));
  const double n = signs.predicted;
  unmatched_ += weight * (1.0 - signs.matched / n - unmatched_);
  rejected_ += weight * (signs.rejected / n - rejected_);
  log_factor_ += weight * (std::log(signs.variance_factor) - log_factor_);
  if (seconds_ < kMemoryS) return;
  const double log_odds = kIntercept + kOfUnmatched * unmatched_ + kOfLogFactor * log_factor_;
  quality_ = 1.0 / (1.0 + std::exp(-log_odds));
  cause_.clear();
  if (quality_ >= kDoubt) return;
  if (calibrationSigmasOff(camera, options) > kCalibrationSigmas) {
    cause_ = "the calibration does not fit: the images ask for another lens than it says";
  } else if (rejected_ > kManyRejected) {
    cause_ =
        "much of the picture does not move as one: something else moves, or is no part of the "
        "scene, or the calibration is wrong";
  } else {
    cause_ =
        "matches scatter more than their templates allow: a wrong calibration, or rectified "
        "images with the calibration of raw ones";
  }
}

}  // namespace active_matching_slam
