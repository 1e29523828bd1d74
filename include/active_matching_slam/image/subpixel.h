#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

/// Offset (u, v) of the peak of a paraboloid fitted by least squares to 3 x 3 scores (row by row,
/// the middle one a local maximum), within [-0.5, 0.5] on each axis. Zero when the fit has no peak.
Eigen::Vector2d paraboloidPeak(const float scores[9]);

/// Where a template fits the image best.
struct TemplateFit {
  Eigen::Vector2d pixel;
  /// Least-squares standard deviation per axis [px], from the residuals of the fit: above that of
  /// the image noise where the patch has changed its appearance.
  double sigma_px = 0.0;
  /// Least-squares covariance of the fit, normalised to trace 2 (mean variance of an axis 1) and
  /// shrunk by a quarter towards the identity. Along an edge it is larger than across.
  Eigen::Matrix2d noise_shape = Eigen::Matrix2d::Identity();
};

/// Aligns the template with the image by translation, gain and offset (inverse compositional
/// Gauss-Newton), from `start` [px], which should be within a pixel of the truth. Empty when it
/// does not converge, moves more than a pixel from `start`, or leaves the image.
std::optional<TemplateFit> refineSubpixel(const cv::Mat& image, const Template& patch,
                                          const Eigen::Vector2d& start);

}  // namespace active_matching_slam
