#pragma once

#include <optional>

#include "active_matching_slam/initialisation/initialiser.h"
#include "active_matching_slam/initialisation/keyframes.h"

namespace active_matching_slam {

/// Mean and covariance of a filter's state after the images of an adjusted hypothesis: the last
/// camera, its velocities by the last two, the calibration, and those features that `filter` has.
/// The covariance is bundleCovariance(), in the gauge of `scale_weights`, which is taken to be
/// known as well as that of a filter; the velocities are uncertain by `accelerations` over
/// `interval_s` too. Empty when it is singular. Corrections are left to the caller.
std::optional<InitialState> makeInitialState(const CameraModel& model, const Ekf& filter,
                                             const BundleOptions& options,
                                             double correlation_inflation,
                                             const MotionHypothesis& hypothesis,
                                             const Eigen::VectorXd& scale_weights,
                                             const Accelerations& accelerations, double interval_s);

/// Takes out features whose image points are outliers on the whole: they are no points of the
/// scene.
void dropOutliers(const CameraModel& model, const BundleOptions& options,
                  MotionHypothesis* hypothesis);

}  // namespace active_matching_slam
