#pragma once

#include <optional>
#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"
#include "active_matching_slam/initialisation/initialiser_options.h"

namespace active_matching_slam {

struct MotionTest {
  Bundle accepted;
  double sigma_px = 0.0;  ///< of the image points, by its reprojection errors
  double log_odds = 0.0;  ///< against the next candidate; infinite when there is none
};

/// Log odds of a candidate of `cost` against another, equal before: the log-likelihood ratio over
/// the variance inflation of errors that are correlated.
double logOdds(double cost, double other_cost, double correlation_inflation);

/// One step of Wald's sequential test between the motions that the image points of `rotation_only`
/// allow: motionCandidates(), each adjusted, and rotation only. Empty while it goes on: no
/// candidate has `InitialiserOptions::log_odds` against all others; or rotation alone, which has
/// fewer parameters, explains the image points as well as a likelihood ratio test of that level can
/// tell (Wilks 1938); or none fits.
std::optional<MotionTest> testMotions(const CameraModel& model, const InitialiserOptions& options,
                                      const BundleOptions& bundle_options,
                                      const Bundle& rotation_only);

}  // namespace active_matching_slam
