#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

namespace active_matching_slam {

/// How an image as a whole moved against the one before: a turn and a shift in the image plane.
struct ImageMotion {
  Eigen::Matrix2d turn = Eigen::Matrix2d::Identity();
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< what it may be off, per axis
  Eigen::Vector2d operator()(const Eigen::Vector2d& previous_px) const {
    return turn * previous_px + shift_px;
  }
};

/// Aligns small, smoothed copies of two 8-bit grey images of one size (Klein and Murray 2008,
/// section 4) by the enhanced correlation coefficient (Evangelidis and Psarakis 2008), from `guess`
/// on. Empty when they have little in common, or when they fit in another place as well. `used`
/// (CV_8U, of their size; empty: all): 0 where neither shows the scene.
std::optional<ImageMotion> estimateImageMotion(const cv::Mat& previous, const cv::Mat& image,
                                               const ImageMotion& guess,
                                               const cv::Mat& used = cv::Mat());

}  // namespace active_matching_slam
