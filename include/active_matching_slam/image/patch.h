#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>

namespace active_matching_slam {

/// What a feature looked like at first sight: larger than the template, so that it can be warped to
/// what is expected from elsewhere. (Chli 2009, section 3.3) And the plane that it lies in, as far
/// as it is known.
struct SourcePatch {
  cv::Mat image;          ///< square, 8-bit grey, odd side; own memory, never written to
  Eigen::Vector2d pixel;  ///< the feature in the first image, sub-pixel [px]
  /// The feature in `image`: pixel (0, 0) of `image` lies at `pixel - center` in the first image.
  Eigen::Vector2d center;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();  ///< at first sight
  /// Relative growth of the inverse depth along the patch, by u and v [1/px]: how the surface is
  /// inclined to the ray of first sight. Zero: it faces the first camera.
  Eigen::Vector2d slope_per_px = Eigen::Vector2d::Zero();
  /// Inverse covariance of it [px^2]; zero before anything has been learnt.
  Eigen::Matrix2d slope_information_px2 = Eigen::Matrix2d::Zero();
};

/// Copies the surroundings of `pixel` (sub-pixel) out of an 8-bit grey image. Empty when the patch
/// would reach beyond the image, or `pixel` is not finite. `size_px` odd.
std::optional<SourcePatch> extractSourcePatch(const cv::Mat& image, const Eigen::Vector2d& pixel,
                                              const Eigen::Isometry3d& T_world_camera, int size_px);

}  // namespace active_matching_slam
