#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace active_matching_slam {

/// Where points of `previous` are in `image`, both 8-bit grey of one size, by pyramidal Lucas-Kanade
/// (Bouguet 2001); empty for a point that is not found, or from which the way back leads elsewhere
/// (forward-backward error; Kalal, Mikolajczyk & Matas 2010), or that was not given.
std::vector<std::optional<Eigen::Vector2d>> trackPoints(
    const cv::Mat& previous, const cv::Mat& image,
    const std::vector<std::optional<Eigen::Vector2d>>& previous_px);

/// Standard deviation per axis of these [px]: what the forward-backward error lets pass.
double flowSigma_px(int image_width);

}  // namespace active_matching_slam
