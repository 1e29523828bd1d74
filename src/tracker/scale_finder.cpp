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
/// Standard deviations that a stretch is long at least. Standard: 3 sigma.
constexpr double kStretchSigmas = 3.0;

/// Square of the length, in units of the errors'.
double signalToNoise(const UncertainVector& way) {
  return way.mean.squaredNorm() / way.covariance.trace();
}

}  // namespace

void ScaleFinder::Ways::add(const UncertainVector& map_step, const UncertainVector& odometry_step,
                            Judge judge) {
  in_map.mean += map_step.mean;
  in_map.covariance += map_step.covariance;
  by_odometry.mean += odometry_step.mean;
  by_odometry.covariance += odometry_step.covariance;
  const bool by_map = judge == Judge::kMap;
  // A stretch that has led nowhere, as the camera stood or turned back, is given up for this step
  // (as in Page's test, 1954).
  if (signalToNoise(by_map ? map_step : odometry_step) >
      signalToNoise(by_map ? in_map : by_odometry)) {
    in_map = map_step;
    by_odometry = odometry_step;
  }
  if (!(signalToNoise(by_map ? in_map : by_odometry) > kStretchSigmas * kStretchSigmas)) return;
  const Eigen::Vector3d &m = in_map.mean, &d = by_odometry.mean;
  const Eigen::Matrix3d &C_m = in_map.covariance, &C_d = by_odometry.covariance;
  map_map += m.squaredNorm() - C_m.trace();
  map_odometry += m.dot(d);
  odometry_odometry += d.squaredNorm() - C_d.trace();
  by_map_errors += m.dot(C_m * m);
  by_odometry_errors += m.dot(C_d * m);
  in_map = by_odometry = UncertainVector();
}

void ScaleFinder::add(const UncertainVector& in_map, const UncertainVector& by_odometry) {
  for_scale_.add(in_map, by_odometry, Judge::kMap);
  for_direction_.add(in_map, by_odometry, Judge::kOdometry);
}

/// Of the ratio k by least squares, d = k m: by the errors of d, and of m.
double ScaleFinder::Ways::relativeVariance(double m_per_map_unit) const {
  return (by_odometry_errors / (m_per_map_unit * m_per_map_unit) + by_map_errors) /
         (map_map * map_map);
}

std::optional<ScaleFinder::Scale> ScaleFinder::scale() const {
  const Ways& ways = for_scale_;
  if (!(ways.map_map > 0.0 && ways.map_odometry > 0.0) || isContradicted()) return std::nullopt;
  const double m_per_map_unit = ways.map_odometry / ways.map_map;
  const double variance = ways.relativeVariance(m_per_map_unit);
  if (!(variance < kKnownScale * kKnownScale)) return std::nullopt;
  return Scale{1.0 / m_per_map_unit, std::sqrt(variance)};
}

bool ScaleFinder::isContradicted() const {
  const Ways& ways = for_direction_;
  if (!(ways.map_map > 0.0 && ways.odometry_odometry > 0.0)) return false;
  // As well known as the ways' lengths would have it, if they agreed.
  return ways.relativeVariance(std::sqrt(ways.odometry_odometry / ways.map_map)) <
             kKnownScale * kKnownScale &&
         ways.map_odometry < kAgreement * std::sqrt(ways.map_map * ways.odometry_odometry);
}

}  // namespace active_matching_slam
