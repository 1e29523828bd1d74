#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/patch.h"
#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

struct FeatureState;

/// How a source patch should look from the present camera.
struct PatchView {
  Eigen::Vector2d pixel;   ///< where the patch's centre projects now [px]
  Eigen::Matrix2d affine;  ///< d(pixel now) / d(pixel at first sight) at the centre
  /// d(affine) / d(slope of the patch): what the way of the camera does to one relative inverse
  /// depth [px]; affine = affine without slope + parallax_px slope_per_px^T.
  Eigen::Vector2d parallax_px = Eigen::Vector2d::Zero();
  /// Squared tangent of the surface's angle to facing the first camera, as a form of the slope.
  Eigen::Matrix2d tangent_metric_px2 = Eigen::Matrix2d::Zero();
  double scale = 1.0;           ///< sqrt |det affine|: size now over size at first sight
  double view_angle_rad = 0.0;  ///< between the rays from first camera and present camera to it
};

/// Homogeneous world point (X, w), w >= 0: position X / w, at infinity for w = 0.
/// For inverse depth (rho * anchor + m, rho), which stays finite as rho -> 0.
Eigen::Vector4d homogeneousPosition(const FeatureState& feature);

/// View of a locally planar patch of the slope known. The homography R - t n^T / d between bearings
/// is exact; together with both lens mappings it is linearised at the centre, which over an 11 x 11
/// template is off by some hundredths of a pixel at its corners. Works for points at infinity
/// (rotation only). Empty when the point is behind a camera, at a camera's centre, outside the lens
/// model, or not finite.
std::optional<PatchView> predictPatchView(const SourcePatch& patch, const CameraModel& camera,
                                          const Eigen::Isometry3d& T_world_camera_now,
                                          const Eigen::Vector4d& point_world_homogeneous);

/// Resamples the source patch as `view` expects it (cubic interpolation; averaged where the patch
/// shrinks), with the feature at the centre of the template's middle pixel. False (and `result`
/// empty) when the template would reach beyond the stored patch or the view is degenerate.
bool warpTemplate(const SourcePatch& patch, const PatchView& view, int template_size_px,
                  Template* result);

}  // namespace active_matching_slam
