#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "active_matching_slam/camera/camera_calibration.h"

namespace active_matching_slam {

/// Correction of a calibration (self-calibration states): a pixel at n from the image centre, over
/// the focal length, moves to centre + (1 + focal + radial |n|^2) n.
struct LensCorrection {
  double focal = 0.0;   ///< relative growth of the focal length
  double radial = 0.0;  ///< relative growth at |n| = 1, beyond that of the focal length
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< shift of the image centre
};

/// Projection between points in the camera's optical frame (x right, y down, z forward; REP 103)
/// and pixels of the raw image (u right, v down, pixel centres at integers), through the lens
/// distortion. Immutable; safe to share between threads.
class CameraModel {
 public:
  /// Throws std::invalid_argument, see checkCalibration().
  explicit CameraModel(const CameraCalibration& calibration);

  const CameraCalibration& calibration() const { return calibration_; }
  int width() const { return calibration_.width; }
  int height() const { return calibration_.height; }

  /// The same camera with `correction` in place of the one that it has.
  CameraModel corrected(const LensCorrection& correction) const;

  /// Pixel of a point (any length, homogeneous scale does not matter) in the camera frame. Empty
  /// when the point is behind the camera or outside the field where the distortion model is
  /// one-to-one. `d_pixel_d_point`, when given, receives the 2 x 3 Jacobian.
  std::optional<Eigen::Vector2d> project(
      const Eigen::Vector3d& point_camera,
      Eigen::Matrix<double, 2, 3>* d_pixel_d_point = nullptr) const;

  /// Jacobian of a pixel that project() returned by the correction: columns focal, radial, centre
  /// (2).
  Eigen::Matrix<double, 2, 4> pixelByCorrection(const Eigen::Vector2d& pixel) const;

  /// Unit bearing in the camera frame of a pixel. Empty where the model can't be inverted.
  /// `d_bearing_d_pixel`, when given, receives the 3 x 2 Jacobian.
  std::optional<Eigen::Vector3d> unproject(
      const Eigen::Vector2d& pixel, Eigen::Matrix<double, 3, 2>* d_bearing_d_pixel = nullptr) const;

  /// True when the pixel lies at least `border_px` inside the image.
  bool isInImage(const Eigen::Vector2d& pixel, double border_px = 0.0) const {
    return pixel.x() >= border_px && pixel.y() >= border_px &&
           pixel.x() <= width() - 1 - border_px && pixel.y() <= height() - 1 - border_px;
  }

 private:
  /// Distorted coordinates by the calibration alone to corrected ones, with the 2 x 2 Jacobian.
  Eigen::Vector2d correct(const Eigen::Vector2d& distorted, Eigen::Matrix2d* jacobian) const;
  /// Inverse of correct(); empty where there is none.
  std::optional<Eigen::Vector2d> uncorrect(const Eigen::Vector2d& corrected) const;
  /// Offset of a pixel from the image centre over the focal length.
  Eigen::Vector2d normalised(const Eigen::Vector2d& pixel) const;
  /// Factor s(r^2) between ideal and radially distorted image coordinates, and its derivative.
  double radialScale(double r2, double* d_scale_d_r2) const;
  /// Ideal to distorted normalised coordinates, with the 2 x 2 Jacobian when asked for.
  Eigen::Vector2d distort(const Eigen::Vector2d& ideal, Eigen::Matrix2d* jacobian) const;
  /// Inverse of distort(); empty outside the one-to-one field.
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& distorted) const;
  /// Ideal radius whose radial distortion is `distorted_radius`.
  std::optional<double> undistortRadius(double distorted_radius) const;
  /// Largest radius up to which the Jacobian of distort() keeps a positive determinant in every
  /// direction.
  double findMaximumRadius() const;

  CameraCalibration calibration_;
  LensCorrection correction_;
  /// k1 k2 p1 p2 k3 k4 k5 k6 (equidistant: k1 k2 k3 k4 first); what the model lacks is zero.
  std::array<double, 8> k_{};
  bool has_tangential_ = false;
  double max_radius2_ = 0.0;  ///< largest x^2 + y^2 (normalised) where distortion is one-to-one
};

}  // namespace active_matching_slam
