#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/image/image_motion.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// The shift of the image, without a turn, that the prediction has on average. `before_px` holds
/// for each feature where it was in the image before, empty where it was not in view.
ImageMotion predictedImageMotion(const MeasurementPrior& prior,
                                 const std::vector<std::optional<Eigen::Vector2d>>& before_px);

/// The prior given how the image as a whole moved: a measurement of three numbers, the mean shift
/// (2) and the turn about their centre of all features together. What one feature moves differently
/// from the rest, by its depth, stays open; and the more the features are expected to move
/// differently, the less the measurement counts. A motion beyond what the prior allows for (a jerk)
/// is taken for what it is: the prior of the common motion is as wide as to make it no surprise.
/// The noise that is inside S stays what it is. Of fewer than three features the prior is returned
/// as it is.
MeasurementPrior conditionOnImageMotion(
    const MeasurementPrior& prior, const std::vector<std::optional<Eigen::Vector2d>>& before_px,
    const ImageMotion& motion);

/// The prior given where its features were tracked to from one image to the next (`flow_px`, empty
/// where they were not), each to `sigma_px` per axis. Flows that the others contradict are left out
/// (data snooping, leaveOneOutInliers()). Empty when these are half of the prior's features or more.
/// The noise that is inside S stays what it is.
std::optional<MeasurementPrior> conditionOnFlow(
    const MeasurementPrior& prior, const std::vector<std::optional<Eigen::Vector2d>>& flow_px,
    double sigma_px);

}  // namespace active_matching_slam
