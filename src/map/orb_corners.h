#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace active_matching_slam {

/// Image points with ORB descriptors.
struct DescribedPoints {
  std::vector<Eigen::Vector2d> pixels;
  cv::Mat descriptors;  ///< a row of 32 bytes for each
};

/// Corners of an 8-bit grey image at scales from enlarged to half, the largest first.
DescribedPoints describeCorners(const cv::Mat& image);

/// Descriptor (1 x 32) at a point of a small image, by the same rules; empty when it has none.
cv::Mat describePoint(const cv::Mat& image, const Eigen::Vector2d& point);

}  // namespace active_matching_slam
