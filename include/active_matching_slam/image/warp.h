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
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< where the patch's centre projects now [px]
  /// d(pixel now) / d(pixel at first sight) at the centre
  Eigen::Matrix2d affine = Eigen::Matrix2d::Identity();
  /// Second derivatives of the pixel at first sight by u u, u v and v v of the pixel now, at the
  /// centre [1/px]: perspective and lens bend a patch that has moved across the image, and all of
  /// them the same way.
  Eigen::Matrix<double, 2, 3> bend_per_px = Eigen::Matrix<double, 2, 3>::Zero();
  /// d(affine) / d(slope of the patch): what the way of the camera does to one relative inverse
  /// depth [px]; affine = affine without slope + parallax_px slope_per_px^T.
  Eigen::Vector2d parallax_px = Eigen::Vector2d::Zero();
  /// Squared tangent of the surface's angle to facing the first camera, as a form of the slope.
  Eigen::Matrix2d tangent_metric_px2 = Eigen::Matrix2d::Zero();
  double scale = 1.0;           ///< sqrt |det affine|: size now over size at first sight
  double view_angle_rad = 0.0;  ///< between the rays from first camera and present camera to it
};

/// View of a locally planar patch of the slope known: the homography R - t n^T / d between bearings
/// and both lens mappings, to second order about the centre. Works for points at infinity (rotation
/// only). Empty when the point is behind a camera, at a camera's centre, outside the lens model, or
/// not finite.
std::optional<PatchView> predictPatchView(const SourcePatch& patch, const CameraModel& camera,
                                          const Eigen::Isometry3d& T_world_camera_now,
                                          const Eigen::Vector4d& point_world_homogeneous);

/// The same but for the bend, which is most of the work and which only templates need.
std::optional<PatchView> predictFlatView(const SourcePatch& patch, const CameraModel& camera,
                                         const Eigen::Isometry3d& T_world_camera_now,
                                         const Eigen::Vector4d& point_world_homogeneous);

/// Bends a flat view of the same patch, camera and point. False when that is not finite.
bool bendView(const SourcePatch& patch, const CameraModel& camera,
              const Eigen::Isometry3d& T_world_camera_now,
              const Eigen::Vector4d& point_world_homogeneous, PatchView* view);

/// Takes an offset from the feature in the present image to that in the first one [px].
class SourceOffset {
 public:
  explicit SourceOffset(const PatchView& view);
  Eigen::Vector2d operator()(double u, double v) const {
    return linear_ * Eigen::Vector2d(u, v) +
           bend_ * Eigen::Vector3d(0.5 * u * u, u * v, 0.5 * v * v);
  }
  /// Offsets of at most `half` on both axes stay within this on both axes.
  Eigen::Vector2d reach(double half) const;
  const Eigen::Matrix2d& linear() const { return linear_; }

 private:
  Eigen::Matrix2d linear_;
  Eigen::Matrix<double, 2, 3> bend_;
};

/// Resamples the source patch as `view` expects it (interpolated; averaged where the patch
/// shrinks), with the feature at the centre of the template's middle pixel. False (and `result`
/// empty) when the template would reach beyond the stored patch or the view is degenerate.
bool warpTemplate(const SourcePatch& patch, const PatchView& view, int template_size_px,
                  Template* result);

/// The patch taken anew from `image`, of the present camera, where the feature was matched at
/// `pixel`: it lies in the same plane. Empty when that is too near the border.
std::optional<SourcePatch> retakeSourcePatch(const SourcePatch& patch, const CameraModel& camera,
                                             const Eigen::Isometry3d& T_world_camera_now,
                                             const Eigen::Vector4d& point_world_homogeneous,
                                             const cv::Mat& image, const Eigen::Vector2d& pixel,
                                             int size_px);

/// What a feature's templates are warped from.
struct TemplateSource {
  SourcePatch patch;
  PatchView view;
};

/// The same on a copy of the image that is halved `level` times (ImagePyramid): of side
/// `template_size_px`, or of the largest smaller one, from 5 on, that the stored patch reaches to.
/// It shows more of the surroundings than the template does.
bool warpCoarseTemplate(const TemplateSource& source, int level, int template_size_px,
                        Template* result);

}  // namespace active_matching_slam
