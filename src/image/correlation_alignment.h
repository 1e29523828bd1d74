#pragma once

#include <opencv2/core.hpp>

namespace active_matching_slam {

/// Turn and shift that take a pixel X of one image to X' = R(angle) X + (u, v) in another.
struct RigidWarp {
  double angle_rad = 0.0, u = 0.0, v = 0.0;
};

/// When alignByCorrelation() ends.
struct AlignmentEnd {
  int most_steps;
  double least_gain;  ///< of the correlation: a step that gains less is the last
};

/// Improves `warp` such that the second image, warped, correlates best with the first: Evangelidis
/// & Psarakis 2008 (ECC), as cv::findTransformECC, at a fraction of its time: one pass over the
/// pixels a step. `first`, `second`: CV_32F, smooth; `used`: of the second's size, CV_8U, 0 where
/// it is not to be looked at; empty: all. Returns the correlation reached, 0 where the steps lead
/// nowhere.
double alignByCorrelation(const cv::Mat& first, const cv::Mat& second, const cv::Mat& used,
                          const AlignmentEnd& end, RigidWarp* warp);

}  // namespace active_matching_slam
