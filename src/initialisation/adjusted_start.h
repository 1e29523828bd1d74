#pragma once

#include <optional>
#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"
#include "active_matching_slam/initialisation/start_adjustment.h"

namespace active_matching_slam {

/// Relative standard deviation of the length of `way` [m], whose covariance is `covariance` [m^2].
double relativeLengthSigma(const Eigen::Vector3d& way, const Eigen::Matrix3d& covariance);

/// The state that a filter would have after the images of `bundle`, the last of which was taken
/// `interval_s` after the one before: mean and covariance of the last camera, its velocities, the
/// calibration, and of those features that `filter` has. `ids` are the bundle's features',
/// ascending, `unit_shares` what they count in its unit of length, which is known to `unit_sigma`
/// (see bundleCovariance()). Empty where the bundle leaves them open. Moves are left to the caller.
std::optional<AdjustedStart> makeAdjustedStart(const CameraModel& model, const Ekf& filter,
                                               const BundleOptions& options, const Bundle& bundle,
                                               const std::vector<FeatureId>& ids,
                                               const Eigen::VectorXd& unit_shares,
                                               double unit_sigma, double interval_s);

/// Whether `filter` knows the distances of the features of `start` clearly better than that does.
bool knowsMore(const Ekf& filter, const AdjustedStart& start);

}  // namespace active_matching_slam
