#include "active_matching_slam/tracker/scale_finder.h"

#include <cmath>

namespace active_matching_slam {
namespace {

/// Relative standard deviation from which on the scale is taken. Derivation: what is left is
/// followed to first order, and half its square, .5 %, is below what odometry is good to.
constexpr double kKnownScale = 0.1;
/// Cosine of the angle between the two ways below which they contradict each other. Derivation: by
/// the other side of it, the scale would be off by more than kKnownScale.
constexpr double kAgreement = 0.9;
/// Standard deviations that a stretch is long at least. Standard: 3 sigma; in a shorter one the
/// odometry shows its errors.
constexpr double kStretchSigmas = 3.0;

}  // namespace

void ScaleFinder::add(const UncertainVector& in_map, const UncertainVector& by_odometry) {
  in_map_.mean += in_map.mean;
  in_map_.covariance += in_map.covariance;
  by_odometry_.mean += by_odometry.mean;
  by_odometry_.covariance += by_odometry.covariance;
  const Eigen::Vector3d &m = in_map_.mean, &d = by_odometry_.mean;
  const Eigen::Matrix3d &C_m = in_map_.covariance, &C_d = by_odometry_.covariance;
  if (!(d.squaredNorm() > kStretchSigmas * kStretchSigmas * C_d.trace())) return;
  map_map_ += m.squaredNorm() - C_m.trace();
  map_odometry_ += m.dot(d);
  odometry_odometry_ += d.squaredNorm() - C_d.trace();
  by_map_errors_ += m.dot(C_m * m);
  by_odometry_errors_ += m.dot(C_d * m);
  in_map_ = by_odometry_ = UncertainVector();
}

/// Of the ratio k by least squares, d = k m: by the errors of d, and of m.
double ScaleFinder::relativeVariance(double m_per_map_unit) const {
  return (by_odometry_errors_ / (m_per_map_unit * m_per_map_unit) + by_map_errors_) /
         (map_map_ * map_map_);
}

std::optional<ScaleFinder::Scale> ScaleFinder::scale() const {
  if (!(map_map_ > 0.0 && map_odometry_ > 0.0) || isContradicted()) return std::nullopt;
  const double m_per_map_unit = map_odometry_ / map_map_;
  const double variance = relativeVariance(m_per_map_unit);
  if (!(variance < kKnownScale * kKnownScale)) return std::nullopt;
  return Scale{1.0 / m_per_map_unit, std::sqrt(variance)};
}

bool ScaleFinder::isContradicted() const {
  if (!(map_map_ > 0.0 && odometry_odometry_ > 0.0)) return false;
  // As well known as the ways' lengths would have it, if they agreed.
  return relativeVariance(std::sqrt(odometry_odometry_ / map_map_)) < kKnownScale * kKnownScale &&
         map_odometry_ < kAgreement * std::sqrt(map_map_ * odometry_odometry_);
}

}  // namespace active_matching_slam
