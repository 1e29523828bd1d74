#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/image_options.h"

namespace active_matching_slam {

/// A point worth tracking. Near the corner found, the place which a template around it keeps best
/// where the image is warped otherwise than foreseen: inclined or bent surfaces, hidden parts.
struct Corner {
  Eigen::Vector2d pixel;  ///< whole numbers: the template there is the image itself, not resampled
  double response = 0.0;  ///< smaller eigenvalue of the structure tensor (Shi & Tomasi 1994)
};

/// Finds up to `wanted` corners in the emptiest parts of an 8-bit grey image: cells with the fewest
/// `occupied` points first, and in each the strongest corner that keeps `minimum_distance_px` from
/// every occupied point and every corner chosen before. Corners keep far enough from the border for
/// a source patch, and none is weaker than options.corner_quality times the strongest met. Only the
/// cells looked at are processed. In order of choice; empty for an empty image. None lies where
/// `centres` (CV_8U, of the image's size; empty: anywhere) is 0.
std::vector<Corner> detectCorners(const cv::Mat& image,
                                  const std::vector<Eigen::Vector2d>& occupied, int wanted,
                                  double minimum_distance_px, const ImageOptions& options,
                                  const cv::Mat& centres = cv::Mat());

}  // namespace active_matching_slam
