#pragma once

#include <vector>

#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

/// By the noise assumed, and with the depths of new features.
BundleOptions startOptions(const FilterOptions& filter);

/// The options for what is of such depths as `reading`.
BundleOptions withDepthsOf(const Bundle& reading, BundleOptions options);

/// Adjusts all of the adjusted `reading` once more, by the noise that it shows as a whole and that
/// each of its images shows, and leaves features that wander out of it, of `believed` and of `ids`.
/// `options` keeps the noise of the whole.
void adjustByItsNoise(const CameraModel& model, BundleOptions* options, Bundle* reading,
                      Bundle* believed, std::vector<FeatureId>* ids);

/// The factor for lengths by which the unit of bundleCovariance() stays. Both bundles have
/// the same features.
double depthFactor(const Eigen::VectorXd& unit_shares, const Bundle& before, const Bundle& bundle);

/// The factor for lengths by which the median of the depths stays.
double medianDepthFactor(const Bundle& before, const Bundle& bundle);

}  // namespace active_matching_slam
