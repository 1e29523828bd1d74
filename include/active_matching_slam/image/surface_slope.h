#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "active_matching_slam/image/patch.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/image/warp.h"

namespace active_matching_slam {

/// Learns from one more image how the surface of a patch is inclined: `expected` was made of it by
/// warpTemplate() for `view`, and matched at `pixel` (sub-pixel) of the 8-bit grey `image`. What
/// is left between the two, once place, gain and offset are free, corrects the slope, weighed with
/// what is known of it. False, and nothing is changed, when it says nothing: too little parallax, a
/// template at the image's border, no contrast. (After Molton, Davison and Reid 2004)
bool learnSlope(const cv::Mat& image, const Eigen::Vector2d& pixel, const Template& expected,
                const PatchView& view, SourcePatch* patch);

}  // namespace active_matching_slam
