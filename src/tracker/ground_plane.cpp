#include "active_matching_slam/tracker/ground_plane.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

namespace active_matching_slam {
namespace {

/// Standard deviations within which a point is on the ground, and beyond which it is below.
/// Standard: 2 and 3 sigma; what is between is neither.
constexpr double kOnGroundSigmas = 2.0, kBelowSigmas = 3.0;
/// Standard deviation of a point's height, by the camera's, above which it tells nothing.
/// Derivation: three of them are then the difference between ground and camera.
constexpr double kVagueHeight = 1.0 / 3.0;
/// Points of which a ground consists at least. Derivation: three make a plane, as many again check
/// it, and as many again may have been no ground.
constexpr int kLeastPoints = 9;
/// Points below, by those on it, with which a ground is none. Cost: with so many wrong matches, or
/// beside so deep a ditch, none is found.
constexpr double kMostBelow = 0.1;
/// Adjustments. Cost: the points on the plane change no more after three or four.
constexpr int kAdjustments = 10;

/// A point in axes of which the second is down.
struct LevelPoint {
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

/// (a, b, h): points on the plane have a x + y + b z = h.
struct Plane {
  double a = 0.0, b = 0.0, h = 0.0;
  double height() const { return h / std::sqrt(1.0 + a * a + b * b); }
};

/// Distances below the plane in units of h, where the normal is nearly the second axis.
struct Deviation {
  double value, sigma;
};

Deviation deviation(const LevelPoint& point, const Plane& plane, double unevenness,
                    double tilt_sigma_rad) {
  const Eigen::Vector3d normal(plane.a, 1.0, plane.b);
  const Eigen::Vector3d& p = point.position;
  const double by_tilt = tilt_sigma_rad * std::hypot(p.x(), p.z());
  const double variance =
      normal.dot(point.covariance * normal) + std::pow(unevenness * plane.h, 2) + by_tilt * by_tilt;
  return {normal.dot(p) - plane.h, std::sqrt(variance)};
}

bool isVague(const Deviation& d, const Plane& plane) { return d.sigma > kVagueHeight * plane.h; }
bool isOn(const Deviation& d) { return std::abs(d.value) < kOnGroundSigmas * d.sigma; }
bool isBelow(const Deviation& d) { return d.value > kBelowSigmas * d.sigma; }

struct Count {
  int on = 0, below = 0;
};

Count count(const std::vector<LevelPoint>& points, const Plane& plane, double unevenness,
            double tilt_sigma_rad) {
  Count count;
  for (const LevelPoint& point : points) {
    const Deviation d = deviation(point, plane, unevenness, tilt_sigma_rad);
    if (isVague(d, plane)) continue;
    if (isOn(d)) ++count.on;
    if (isBelow(d)) ++count.below;
  }
  return count;
}

/// Least squares over the points that are on the plane; returns the variance of its h.
double adjust(const std::vector<LevelPoint>& points, const GroundOptions& options,
              double tilt_sigma_rad, bool is_first, Plane* plane) {
  Eigen::Matrix3d N = Eigen::Matrix3d::Zero();
  N(0, 0) = N(1, 1) = 1.0 / (tilt_sigma_rad * tilt_sigma_rad);
  Eigen::Vector3d y = Eigen::Vector3d::Zero();
  for (const LevelPoint& point : points) {
    const Deviation own = deviation(point, *plane, options.unevenness, 0.0);
    // At first the tilt is as it is known beforehand.
    const Deviation d =
        is_first ? deviation(point, *plane, options.unevenness, tilt_sigma_rad) : own;
    if (isVague(d, *plane) || !isOn(d)) continue;
    const Eigen::Vector3d row(point.position.x(), point.position.z(), -1.0);
    const double weight = 1.0 / (own.sigma * own.sigma);
    N += weight * row * row.transpose();
    y -= weight * point.position.y() * row;
  }
  const Eigen::LLT<Eigen::Matrix3d> factor(N);
  if (factor.info() != Eigen::Success) return -1.0;
  const Eigen::Vector3d x = factor.solve(y);
  *plane = {x[0], x[1], x[2]};
  return factor.solve(Eigen::Vector3d::UnitZ()).z();
}

}  // namespace

Eigen::Vector3d GroundOptions::downCamera() const {
  const double pitch = camera_pitch_deg * M_PI / 180.0;
  return {0.0, std::cos(pitch), std::sin(pitch)};
}

std::optional<GroundPlane> findGround(const std::vector<PointBelow>& points,
                                      const Eigen::Vector3d& down_camera,
                                      const GroundOptions& options) {
  const Eigen::Matrix3d R_level_camera =
      Eigen::Quaterniond::FromTwoVectors(down_camera, Eigen::Vector3d::UnitY()).toRotationMatrix();
  std::vector<LevelPoint> level;
  for (const PointBelow& point : points)
    level.push_back({R_level_camera * point.position_camera,
                     R_level_camera * point.covariance * R_level_camera.transpose()});
  const double tilt_sigma_rad = options.tilt_sigma_deg * M_PI / 180.0;

  Plane plane;
  int best = 0;
  for (const LevelPoint& point : level) {
    if (!(point.position.y() > 0.0)) continue;
    const Plane proposed{0.0, 0.0, point.position.y()};
    const Count counted = count(level, proposed, options.unevenness, tilt_sigma_rad);
    if (counted.on - counted.below <= best) continue;
    best = counted.on - counted.below;
    plane = proposed;
  }
  if (best == 0) return std::nullopt;
  double variance = 0.0;
  for (int i = 0; i < kAdjustments; ++i) {
    variance = adjust(level, options, tilt_sigma_rad, i == 0, &plane);
    if (!(variance > 0.0 && plane.h > 0.0)) return std::nullopt;
  }
  const Count counted = count(level, plane, options.unevenness, 0.0);
  if (counted.on < kLeastPoints || counted.below > kMostBelow * counted.on) return std::nullopt;
  GroundPlane ground;
  ground.down_camera =
      R_level_camera.transpose() * Eigen::Vector3d(plane.a, 1.0, plane.b).normalized();
  ground.height = plane.height();
  ground.relative_sigma = std::sqrt(variance) / plane.h;
  ground.points = counted.on;
  ground.points_below = counted.below;
  return ground;
}

}  // namespace active_matching_slam
