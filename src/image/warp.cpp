#include "active_matching_slam/image/warp.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sampling.h"

namespace active_matching_slam {
namespace {

/// Interpolates at positions from (-0.5, -0.5) on; beyond the rim the outermost pixels repeat.
float sample(const cv::Mat& image, double u, double v) {
  // Truncation is the floor of what is positive, and far cheaper.
  const int at_u = static_cast<int>(u + 1.0) - 1, at_v = static_cast<int>(v + 1.0) - 1;
  const int first_u = at_u - kTapsBefore, first_v = at_v - kTapsBefore;
  float weights_u[kTaps], weights_v[kTaps];
  interpolationWeights(u - at_u, weights_u);
  interpolationWeights(v - at_v, weights_v);
  float columns[kTaps] = {};
  if (first_u >= 0 && first_v >= 0 && first_u + kTaps <= image.cols &&
      first_v + kTaps <= image.rows) {
    for (int j = 0; j < kTaps; ++j) {
      const std::uint8_t* row = image.ptr<std::uint8_t>(first_v + j) + first_u;
      for (int i = 0; i < kTaps; ++i) columns[i] += weights_v[j] * static_cast<float>(row[i]);
    }
  } else {
    for (int j = 0; j < kTaps; ++j) {
      const auto* row = image.ptr<std::uint8_t>(std::clamp(first_v + j, 0, image.rows - 1));
      for (int i = 0; i < kTaps; ++i)
        columns[i] += weights_v[j] * row[std::clamp(first_u + i, 0, image.cols - 1)];
    }
  }
  float value = 0.0f;
  for (int i = 0; i < kTaps; ++i) value += weights_u[i] * columns[i];
  return value;
}

/// Side of the smallest coarse template [px]. Cost: smaller ones resemble more places of the image,
/// each of which is looked at again; of this one 97 % of the true places are among the best twenty.
constexpr int kLeastCoarseSize = 5;

/// How many samples a side stand for one template pixel: more where the patch shrinks, lest fine
/// texture turns into noise.
int samplesPerPixel(const Eigen::Matrix2d& source_per_pixel) {
  const double longest = std::max(source_per_pixel.col(0).norm(), source_per_pixel.col(1).norm());
  return std::clamp(static_cast<int>(std::lround(longest)), 1, 4);
}

/// Second derivatives of `source`, which takes an offset of the pixel now to an optional offset of
/// the pixel at first sight and zero to zero, by differences as wide as a template. Zero where
/// `source` is empty.
template <typename Source>
Eigen::Matrix<double, 2, 3> secondDerivatives(const Source& source) {
  constexpr double h = 5.0;
  const auto right = source({h, 0}), left = source({-h, 0});
  const auto below = source({0, h}), above = source({0, -h});
  const auto after = source({h, h}), before = source({-h, -h});
  Eigen::Matrix<double, 2, 3> result = Eigen::Matrix<double, 2, 3>::Zero();
  if (!right || !left || !below || !above || !after || !before) return result;
  const Eigen::Vector2d along_u = *right + *left, along_v = *below + *above;
  result << along_u, 0.5 * (*after + *before - along_u - along_v), along_v;
  return result / (h * h);
}

/// The homography of a patch's plane. With that plane n^T X = d through the point, n^T bearing = 1,
/// X = b d / (n . b) along a ray b, so R X + t is parallel to (R + t n^T / d) b (Hartley &
/// Zisserman 2004, section 13.1). The inverse depth along b grows by d(n . b), which is the slope;
/// where the patch faces the first camera, n is the bearing, and that is none.
struct PatchPlane {
  Eigen::Vector3d bearing;                        ///< of the feature in the first camera
  Eigen::Matrix<double, 3, 2> d_bearing_d_first;  ///< by the pixel at first sight
  Eigen::Matrix3d R_now_first;
  Eigen::Vector3d shift;  ///< t / d, in the camera now
};

/// Empty when the point is at the first camera's centre or that does not see it, or not finite.
std::optional<PatchPlane> planeOf(const SourcePatch& patch, const CameraModel& camera,
                                  const Eigen::Isometry3d& T_world_camera_now,
                                  const Eigen::Vector4d& point_world_homogeneous) {
  const Eigen::Isometry3d& T_world_first = patch.T_world_camera;
  const double w = point_world_homogeneous.w();
  const double distance =
      (point_world_homogeneous.head<3>() - w * T_world_first.translation()).norm();
  if (!(distance > 0.0) || !(w >= 0.0)) return std::nullopt;
  const double inverse_distance = w / distance;  // from the first camera
  if (!std::isfinite(inverse_distance)) return std::nullopt;
  PatchPlane plane;
  const auto bearing = camera.unproject(patch.pixel, &plane.d_bearing_d_first);
  if (!bearing) return std::nullopt;
  plane.bearing = *bearing;
  const Eigen::Matrix3d R_now_world = T_world_camera_now.linear().transpose();
  plane.R_now_first = R_now_world * T_world_first.linear();
  plane.shift = inverse_distance *
                (R_now_world * (T_world_first.translation() - T_world_camera_now.translation()));
  return plane;
}

/// Of the plane, in the camera now; any length.
Eigen::Vector3d normalNow(const PatchPlane& plane, const Eigen::Matrix2d& tangent_metric_px2,
                          const Eigen::Vector2d& slope_per_px) {
  return plane.R_now_first *
         (plane.bearing + plane.d_bearing_d_first * (tangent_metric_px2 * slope_per_px));
}

}  // namespace

std::optional<PatchView> predictFlatView(const SourcePatch& patch, const CameraModel& camera,
                                         const Eigen::Isometry3d& T_world_camera_now,
                                         const Eigen::Vector4d& point_world_homogeneous) {
  const auto plane = planeOf(patch, camera, T_world_camera_now, point_world_homogeneous);
  if (!plane) return std::nullopt;
  const Eigen::Vector3d first_ray = plane->R_now_first * plane->bearing;
  const Eigen::Vector3d point_now = first_ray + plane->shift;

  Eigen::Matrix<double, 2, 3> d_now_d_point;
  const std::optional<Eigen::Vector2d> pixel = camera.project(point_now, &d_now_d_point);
  if (!pixel) return std::nullopt;

  PatchView view;
  view.pixel = *pixel;
  view.parallax_px = d_now_d_point * plane->shift;
  view.tangent_metric_px2 =
      (plane->d_bearing_d_first.transpose() * plane->d_bearing_d_first).inverse();
  view.affine = d_now_d_point * plane->R_now_first * plane->d_bearing_d_first +
                view.parallax_px * patch.slope_per_px.transpose();
  if (!view.pixel.allFinite() || !view.affine.allFinite() || !view.tangent_metric_px2.allFinite())
    return std::nullopt;
  view.scale = std::sqrt(std::abs(view.affine.determinant()));
  view.view_angle_rad = std::atan2(first_ray.cross(point_now).norm(), first_ray.dot(point_now));
  return view;
}

bool bendView(const SourcePatch& patch, const CameraModel& camera,
              const Eigen::Isometry3d& T_world_camera_now,
              const Eigen::Vector4d& point_world_homogeneous, PatchView* view) {
  const auto plane = planeOf(patch, camera, T_world_camera_now, point_world_homogeneous);
  if (!plane) return false;
  // The homography inverted, by Sherman and Morrison: b ~ R^T (b' (1 + m . t) - t (m . b')), where
  // m = R n.
  const Eigen::Vector3d normal_now =
      normalNow(*plane, view->tangent_metric_px2, patch.slope_per_px);
  const double facing = 1.0 + normal_now.dot(plane->shift);
  if (!(facing > 0.0)) return std::isfinite(facing);
  const Eigen::Matrix3d R_first_now = plane->R_now_first.transpose();
  view->bend_per_px = secondDerivatives([&](const Eigen::Vector2d& offset) {
    std::optional<Eigen::Vector2d> source;
    if (const auto ray = camera.unproject(view->pixel + offset))
      source = camera.project(R_first_now * (facing * *ray - normal_now.dot(*ray) * plane->shift));
    if (source) *source -= patch.pixel;
    return source;
  });
  return view->bend_per_px.allFinite();
}

std::optional<PatchView> predictPatchView(const SourcePatch& patch, const CameraModel& camera,
                                          const Eigen::Isometry3d& T_world_camera_now,
                                          const Eigen::Vector4d& point_world_homogeneous) {
  auto view = predictFlatView(patch, camera, T_world_camera_now, point_world_homogeneous);
  if (view && !bendView(patch, camera, T_world_camera_now, point_world_homogeneous, &*view))
    return std::nullopt;
  return view;
}

SourceOffset::SourceOffset(const PatchView& view)
    : linear_(view.affine.inverse()), bend_(view.bend_per_px) {}

Eigen::Vector2d SourceOffset::reach(double half) const {
  const double squared = half * half;
  return linear_.cwiseAbs() * Eigen::Vector2d(half, half) +
         bend_.cwiseAbs() * Eigen::Vector3d(0.5 * squared, squared, 0.5 * squared);
}

bool warpTemplate(const SourcePatch& patch, const PatchView& view, int template_size_px,
                  Template* result) {
  result->size = 0;
  result->sum = result->energy = 0;
  if (template_size_px < 1 || template_size_px > Template::kMaximumSize || patch.image.empty() ||
      !(view.affine.determinant() > 1e-6))  // a mirrored or edge-on plane shows nothing
    return false;
  const SourceOffset source_offset(view);
  const int half = template_size_px / 2;
  const Eigen::Vector2d reach = source_offset.reach(half);
  const Eigen::Vector2d last(patch.image.cols - 0.5, patch.image.rows - 0.5);
  if (!((patch.center - reach).minCoeff() >= -0.5) ||
      !((last - patch.center - reach).minCoeff() >= 0.0))
    return false;

  const int samples = samplesPerPixel(source_offset.linear());
  const double step = 1.0 / samples, first = 0.5 * (step - 1.0);
  std::uint8_t* pixel = result->pixels.data();
  for (int dv = -half; dv <= half; ++dv) {
    for (int du = -half; du <= half; ++du) {
      double total = 0.0;
      for (int j = 0; j < samples; ++j)
        for (int i = 0; i < samples; ++i) {
          const Eigen::Vector2d source =
              patch.center + source_offset(du + first + i * step, dv + first + j * step);
          total += sample(patch.image, source.x(), source.y());
        }
      const double value = std::clamp(total * step * step, 0.0, 255.0);
      *pixel++ = static_cast<std::uint8_t>(value + 0.5);
    }
  }
  result->size = template_size_px;
  updateSums(result);
  return true;
}

std::optional<SourcePatch> retakeSourcePatch(const SourcePatch& patch, const CameraModel& camera,
                                             const Eigen::Isometry3d& T_world_camera_now,
                                             const Eigen::Vector4d& point_world_homogeneous,
                                             const cv::Mat& image, const Eigen::Vector2d& pixel,
                                             int size_px) {
  auto retaken = extractSourcePatch(image, pixel, T_world_camera_now, size_px);
  if (!retaken || patch.slope_information_px2.isZero(0.0)) return retaken;
  const auto view = predictFlatView(patch, camera, T_world_camera_now, point_world_homogeneous);
  const auto plane = planeOf(patch, camera, T_world_camera_now, point_world_homogeneous);
  Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
  const auto bearing = camera.unproject(pixel, &d_bearing_d_pixel);
  if (!view || !plane || !bearing) return std::nullopt;
  const Eigen::Vector3d normal = normalNow(*plane, view->tangent_metric_px2, patch.slope_per_px);
  const double facing = normal.dot(*bearing);
  if (!(facing > 0.0)) return std::nullopt;
  retaken->slope_per_px = d_bearing_d_pixel.transpose() * normal / facing;
  const Eigen::Matrix2d information =
      view->affine * patch.slope_information_px2 * view->affine.transpose();
  retaken->slope_information_px2 = 0.5 * (information + information.transpose());
  return retaken;
}

bool warpCoarseTemplate(const TemplateSource& source, int level, int template_size_px,
                        Template* result) {
  SourcePatch patch = source.patch;
  PatchView view = source.view;
  for (int halved = 0; halved < level; ++halved) {
    cv::Mat half;
    cv::pyrDown(patch.image, half, cv::Size(), cv::BORDER_REPLICATE);
    patch.image = half;
    patch.center *= 0.5;
    view.bend_per_px *= 2.0;
  }
  for (int size = template_size_px; size >= kLeastCoarseSize; size -= 2)
    if (warpTemplate(patch, view, size, result)) return true;
  return false;
}

}  // namespace active_matching_slam
