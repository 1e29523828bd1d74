#include "active_matching_slam/camera/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

// Rays more than 89.94 degrees off the axis have no usable normalised coordinates.
constexpr double kLargestRadius = 1000.0;
// Convergence of the inverse, in normalised coordinates (below 1e-9 px for any real focal length).
constexpr double kTolerance = 1e-13;

/// Solves f(x) = target for an f that increases on [0, upper], f(0) = 0, by Newton's method kept
/// inside a shrinking bracket. `f` returns the value and writes the derivative.
template <typename F>
std::optional<double> solveIncreasing(double target, double upper, F f) {
  double low = 0.0, high = upper;
  double x = std::min(target, upper);
  for (int iteration = 0; iteration < 60; ++iteration) {
    double slope;
    const double residual = f(x, &slope) - target;
    if (std::abs(residual) <= kTolerance * (1.0 + target)) return x;
    (residual > 0.0 ? high : low) = x;
    double next = x - residual / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    // At the rim of the field: nothing between the bracket's ends any more, or out of reach.
    if (next == x || high - low <= 1e-15 * upper) break;
    x = next;
  }
  return std::nullopt;
}

}  // namespace

CameraModel::CameraModel(const CameraCalibration& calibration) : calibration_(calibration) {
  checkCalibration(calibration_);
  std::copy_n(calibration_.distortion.begin(),
              std::min<std::size_t>(8, calibration_.distortion.size()), k_.begin());
  has_tangential_ = calibration_.distortion_model != DistortionModel::kEquidistant &&
                    (k_[2] != 0.0 || k_[3] != 0.0);
  const double max_radius = findMaximumRadius();
  max_radius2_ = max_radius * max_radius;
}

double CameraModel::radialScale(double r2, double* d_scale_d_r2) const {
  switch (calibration_.distortion_model) {
    case DistortionModel::kNone:
      break;
    case DistortionModel::kPlumbBob:
      *d_scale_d_r2 = k_[0] + r2 * (2.0 * k_[1] + r2 * 3.0 * k_[4]);
      return 1.0 + r2 * (k_[0] + r2 * (k_[1] + r2 * k_[4]));
    case DistortionModel::kRationalPolynomial: {
      const double numerator = 1.0 + r2 * (k_[0] + r2 * (k_[1] + r2 * k_[4]));
      const double d_numerator = k_[0] + r2 * (2.0 * k_[1] + r2 * 3.0 * k_[4]);
      const double inverse = 1.0 / (1.0 + r2 * (k_[5] + r2 * (k_[6] + r2 * k_[7])));
      const double d_denominator = k_[5] + r2 * (2.0 * k_[6] + r2 * 3.0 * k_[7]);
      const double scale = numerator * inverse;
      *d_scale_d_r2 = (d_numerator - scale * d_denominator) * inverse;
      return scale;
    }
    case DistortionModel::kEquidistant: {
      if (r2 < 1e-10) {  // theta = r - r^3 / 3 + ...
        *d_scale_d_r2 = k_[0] - 1.0 / 3.0;
        return 1.0 + *d_scale_d_r2 * r2;
      }
      const double r = std::sqrt(r2);
      const double theta = std::atan(r);
      const double t2 = theta * theta;
      const double theta_d =
          theta * (1.0 + t2 * (k_[0] + t2 * (k_[1] + t2 * (k_[2] + t2 * k_[3]))));
      const double d_theta_d =
          1.0 + t2 * (3.0 * k_[0] + t2 * (5.0 * k_[1] + t2 * (7.0 * k_[2] + t2 * 9.0 * k_[3])));
      const double scale = theta_d / r;
      *d_scale_d_r2 = (d_theta_d / (1.0 + r2) - scale) / (2.0 * r2);
      return scale;
    }
  }
  *d_scale_d_r2 = 0.0;
  return 1.0;
}

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d& ideal,
                                     Eigen::Matrix2d* jacobian) const {
  const double x = ideal.x(), y = ideal.y();
  const double r2 = x * x + y * y;
  double d_scale;
  const double scale = radialScale(r2, &d_scale);
  Eigen::Vector2d distorted(scale * x, scale * y);
  if (jacobian) {
    const double cross = 2.0 * d_scale * x * y;
    *jacobian << scale + 2.0 * d_scale * x * x, cross, cross, scale + 2.0 * d_scale * y * y;
  }
  if (has_tangential_) {
    const double p1 = k_[2], p2 = k_[3];
    distorted.x() += 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    distorted.y() += p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    if (jacobian) {
      const double cross = 2.0 * (p1 * x + p2 * y);
      (*jacobian)(0, 0) += 2.0 * p1 * y + 6.0 * p2 * x;
      (*jacobian)(0, 1) += cross;
      (*jacobian)(1, 0) += cross;
      (*jacobian)(1, 1) += 6.0 * p1 * y + 2.0 * p2 * x;
    }
  }
  return distorted;
}

double CameraModel::findMaximumRadius() const {
  if (calibration_.distortion_model == DistortionModel::kNone) return kLargestRadius;
  const auto isOneToOne = [this](double radius, double direction) {
    Eigen::Matrix2d jacobian;
    distort(radius * Eigen::Vector2d(std::cos(direction), std::sin(direction)), &jacobian);
    // A positive trace as well: two eigenvalues that turned negative fold the image twice.
    return jacobian.determinant() > 0.0 && jacobian.trace() > 0.0;
  };
  // Equal steps in the angle off the axis; radial distortion alone is the same in all directions.
  constexpr int kSteps = 2000;
  const double largest_angle = std::atan(kLargestRadius);
  const int directions = has_tangential_ ? 90 : 1;
  double result = kLargestRadius;
  for (int d = 0; d < directions; ++d) {
    const double direction = 2.0 * M_PI * d / directions;
    double good = 0.0;
    for (int step = 1; step <= kSteps; ++step) {
      double bad = std::tan(largest_angle * step / kSteps);
      if (good >= result) break;
      if (isOneToOne(bad, direction)) {
        good = bad;
        continue;
      }
      for (int halving = 0; halving < 50; ++halving) {
        const double middle = 0.5 * (good + bad);
        (isOneToOne(middle, direction) ? good : bad) = middle;
      }
      result = std::min(result, good);
      break;
    }
  }
  return result;
}

std::optional<Eigen::Vector2d> CameraModel::project(
    const Eigen::Vector3d& point_camera, Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const {
  if (!(point_camera.z() > 0.0)) return std::nullopt;
  const double inverse_z = 1.0 / point_camera.z();
  const Eigen::Vector2d ideal = point_camera.head<2>() * inverse_z;
  if (!(ideal.squaredNorm() <= max_radius2_)) return std::nullopt;
  Eigen::Matrix2d d_distorted, d_corrected;
  const Eigen::Vector2d corrected =
      correct(distort(ideal, d_pixel_d_point ? &d_distorted : nullptr), &d_corrected);
  if (!(d_corrected.determinant() > 0.0 && d_corrected.trace() > 0.0)) return std::nullopt;
  if (d_pixel_d_point) {
    Eigen::Matrix2d jacobian = d_corrected * d_distorted;
    jacobian.row(0) *= calibration_.fx * inverse_z;
    jacobian.row(1) *= calibration_.fy * inverse_z;
    d_pixel_d_point->leftCols<2>() = jacobian;
    d_pixel_d_point->col(2) = -jacobian * ideal;
  }
  return Eigen::Vector2d(calibration_.fx * corrected.x() + calibration_.cx,
                         calibration_.fy * corrected.y() + calibration_.cy);
}

CameraModel CameraModel::corrected(const LensCorrection& correction) const {
  CameraModel camera = *this;
  camera.correction_ = correction;
  return camera;
}

Eigen::Vector2d CameraModel::correct(const Eigen::Vector2d& distorted,
                                     Eigen::Matrix2d* jacobian) const {
  const auto& [focal, radial, centre] = correction_;
  const double scale = 1.0 + focal + radial * distorted.squaredNorm();
  *jacobian =
      scale * Eigen::Matrix2d::Identity() + 2.0 * radial * distorted * distorted.transpose();
  return centre + scale * distorted;
}

std::optional<Eigen::Vector2d> CameraModel::uncorrect(const Eigen::Vector2d& corrected) const {
  Eigen::Vector2d solution = corrected - correction_.centre;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d residual = correct(solution, &jacobian) - corrected;
    if (!(jacobian.determinant() > 0.0)) return std::nullopt;
    if (residual.squaredNorm() <= kTolerance * kTolerance * (1.0 + corrected.squaredNorm()))
      return solution;
    solution -= jacobian.inverse() * residual;
  }
  return std::nullopt;
}

Eigen::Vector2d CameraModel::normalised(const Eigen::Vector2d& pixel) const {
  return {(pixel.x() - calibration_.cx) / calibration_.fx,
          (pixel.y() - calibration_.cy) / calibration_.fy};
}

Eigen::Matrix<double, 2, 4> CameraModel::pixelByCorrection(const Eigen::Vector2d& pixel) const {
  Eigen::Matrix<double, 2, 4> J = Eigen::Matrix<double, 2, 4>::Zero();
  J.rightCols<2>().setIdentity();
  if (const auto distorted = uncorrect(normalised(pixel))) {
    J.col(0) = *distorted;
    J.col(1) = distorted->squaredNorm() * *distorted;
  }
  J.row(0) *= calibration_.fx;
  J.row(1) *= calibration_.fy;
  return J;
}

std::optional<double> CameraModel::undistortRadius(double distorted_radius) const {
  const double max_radius = std::sqrt(max_radius2_);
  if (calibration_.distortion_model == DistortionModel::kEquidistant) {
    // Solved in the angle: a polynomial, and well conditioned towards 90 degrees.
    const auto distorted_angle = [this](double theta, double* slope) {
      const double t2 = theta * theta;
      *slope =
          1.0 + t2 * (3.0 * k_[0] + t2 * (5.0 * k_[1] + t2 * (7.0 * k_[2] + t2 * 9.0 * k_[3])));
      return theta * (1.0 + t2 * (k_[0] + t2 * (k_[1] + t2 * (k_[2] + t2 * k_[3]))));
    };
    const auto theta = solveIncreasing(distorted_radius, std::atan(max_radius), distorted_angle);
    return theta ? std::optional<double>(std::tan(*theta)) : std::nullopt;
  }
  return solveIncreasing(distorted_radius, max_radius, [this](double r, double* slope) {
    double d_scale;
    const double scale = radialScale(r * r, &d_scale);
    *slope = scale + 2.0 * d_scale * r * r;
    return r * scale;
  });
}

std::optional<Eigen::Vector2d> CameraModel::undistort(const Eigen::Vector2d& distorted) const {
  if (calibration_.distortion_model == DistortionModel::kNone) return distorted;
  const double distorted_radius = distorted.norm();
  if (!std::isfinite(distorted_radius)) return std::nullopt;
  const std::optional<double> radius = undistortRadius(distorted_radius);
  if (!has_tangential_) {
    if (!radius) return std::nullopt;
    if (distorted_radius == 0.0) return distorted;
    return Eigen::Vector2d(distorted * (*radius / distorted_radius));
  }
  // Tangential distortion is small: the radial inverse is a good start for Newton in the plane.
  const double start = radius ? *radius : std::sqrt(max_radius2_);
  Eigen::Vector2d ideal = distorted_radius > 0.0
                              ? Eigen::Vector2d(distorted * (start / distorted_radius))
                              : Eigen::Vector2d::Zero();
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d residual = distort(ideal, &jacobian) - distorted;
    const double determinant = jacobian.determinant();
    if (!(determinant > 0.0)) return std::nullopt;
    if (residual.squaredNorm() <= kTolerance * kTolerance * (1.0 + distorted.squaredNorm())) {
      if (ideal.squaredNorm() > max_radius2_) return std::nullopt;
      return ideal;
    }
    ideal -= Eigen::Vector2d(jacobian(1, 1) * residual.x() - jacobian(0, 1) * residual.y(),
                             jacobian(0, 0) * residual.y() - jacobian(1, 0) * residual.x()) /
             determinant;
  }
  return std::nullopt;
}

std::optional<Eigen::Vector3d> CameraModel::unproject(
    const Eigen::Vector2d& pixel, Eigen::Matrix<double, 3, 2>* d_bearing_d_pixel) const {
  const std::optional<Eigen::Vector2d> distorted = uncorrect(normalised(pixel));
  if (!distorted) return std::nullopt;
  const std::optional<Eigen::Vector2d> ideal = undistort(*distorted);
  if (!ideal || !(ideal->squaredNorm() <= max_radius2_)) return std::nullopt;
  const double inverse_norm = 1.0 / std::sqrt(ideal->squaredNorm() + 1.0);
  const Eigen::Vector3d bearing = Eigen::Vector3d(ideal->x(), ideal->y(), 1.0) * inverse_norm;
  if (d_bearing_d_pixel) {
    Eigen::Matrix2d d_distorted, d_corrected;
    distort(*ideal, &d_distorted);
    correct(*distorted, &d_corrected);
    Eigen::Matrix2d d_ideal_d_pixel = (d_corrected * d_distorted).inverse();
    d_ideal_d_pixel.col(0) /= calibration_.fx;
    d_ideal_d_pixel.col(1) /= calibration_.fy;
    Eigen::Matrix<double, 3, 2> d_bearing_d_ideal = -bearing * bearing.head<2>().transpose();
    d_bearing_d_ideal(0, 0) += 1.0;
    d_bearing_d_ideal(1, 1) += 1.0;
    *d_bearing_d_pixel = inverse_norm * d_bearing_d_ideal * d_ideal_d_pixel;
  }
  return bearing;
}

}  // namespace active_matching_slam
