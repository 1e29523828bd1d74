#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/camera/camera_model.h"
#include "textures.h"

namespace active_matching_slam {

inline CameraModel wideCamera() {
  CameraCalibration calibration;
  calibration.width = 320;
  calibration.height = 240;
  calibration.fx = 195.0;
  calibration.fy = 196.0;
  calibration.cx = 162.0;
  calibration.cy = 121.0;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {-0.25, 0.06, 0.001, -0.0005, 0.0};
  return CameraModel(calibration);
}

inline Eigen::Isometry3d pose(const Eigen::Vector3d& position, const Eigen::Vector3d& rotation) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  if (rotation.norm() > 0.0)
    T.linear() = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
  T.translation() = position;
  return T;
}

inline Eigen::Vector4d finitePoint(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z(), 1.0}; }

/// A textured plane through a point, and what cameras see of it exactly.
class Plane {
 public:
  Plane(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double wave)
      : point_(point),
        normal_(normal),
        x_(normal.unitOrthogonal()),
        y_(normal.cross(x_)),
        texture_(21, wave, 35.0) {}

  /// The plane's point seen at a pixel.
  Eigen::Vector3d at(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                     const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d ray = T_world_camera.linear() * *camera.unproject(pixel);
    const Eigen::Vector3d& origin = T_world_camera.translation();
    return origin + ray * (normal_.dot(point_ - origin) / normal_.dot(ray));
  }
  const Eigen::Vector3d& normal() const { return normal_; }
  /// Grey level at a pixel: the mean over its area.
  double grey(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
              const Eigen::Vector2d& pixel) const {
    double sum = 0.0;
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d d =
            at(camera, T_world_camera, pixel + Eigen::Vector2d(i - 1, j - 1) / 3.0) - point_;
        sum += texture_.value(d.dot(x_), d.dot(y_));
      }
    return sum / 9.0;
  }
  /// Image around a pixel; the rest stays black.
  cv::Mat render(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                 const Eigen::Vector2d& pixel, int half) const {
    cv::Mat image(camera.height(), camera.width(), CV_8UC1, cv::Scalar(0));
    const int center_u = static_cast<int>(pixel.x()), center_v = static_cast<int>(pixel.y());
    for (int v = center_v - half; v <= center_v + half; ++v)
      for (int u = center_u - half; u <= center_u + half; ++u)
        image.at<std::uint8_t>(v, u) =
            WaveTexture::toGrey(grey(camera, T_world_camera, Eigen::Vector2d(u, v)));
    return image;
  }

 private:
  Eigen::Vector3d point_, normal_, x_, y_;
  WaveTexture texture_;
};

/// What the template should be: the plane seen exactly, on the grid around the predicted pixel.
inline cv::Mat exactTemplate(const Plane& plane, const CameraModel& camera,
                             const Eigen::Isometry3d& now, const Eigen::Vector2d& pixel, int size) {
  cv::Mat image(size, size, CV_8UC1);
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i)
      image.at<std::uint8_t>(j, i) = WaveTexture::toGrey(
          plane.grey(camera, now, pixel + Eigen::Vector2d(i - size / 2, j - size / 2)));
  return image;
}

inline double correlation(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat score;
  cv::matchTemplate(a, b, score, cv::TM_CCOEFF_NORMED);
  return score.at<float>(0);
}

}  // namespace active_matching_slam
