#include "active_matching_slam/tracker/scale_finder.h"

#include <cmath>

namespace active_matching_slam {
namespace {

/// Relative standard deviation from which on the scale is taken. Derivation: what is left is
/// followed to first order, and half its square, .5 %, is below what odometry is good to.
constexpr double kKnownScale = 0.1;
/// Cosine of the angle between the two ways below which they contradict each other. Derivation: by
/// the other side of it, the scale would be off by more than kKnownScale.
constexpr double kAgreement = 1.0 - kKnownScale;

}  // namespace

void ScaleFinder::add(const UncertainVector& in_map, const UncertainVector& by_odometry) {
  in_map_.mean += in_map.mean;
  in_map_.covariance += in_map.covariance;
  by_odometry_.mean += by_odometry.mean;
  by_odometry_.covariance += by_odometry.covariance;
}

std::optional<ScaleFinder::Scale> ScaleFinder::scale() const {
  const double way_m = by_odometry_.mean.norm();
  if (!(way_m > 0.0) || isContradicted()) return std::nullopt;
  const Eigen::Vector3d u = by_odometry_.mean / way_m;
  const double way_in_map = u.dot(in_map_.mean);
  if (!(way_in_map > 0.0)) return std::nullopt;
  const double variance =
      u.dot(in_map_.covariance * u) / (way_in_map * way_in_map) +
      u.dot(by_odometry_.covariance * u) / (way_m * way_m);
  if (!(variance < kKnownScale * kKnownScale)) return std::nullopt;
  return Scale{way_in_map / way_m, std::sqrt(variance)};
}

bool ScaleFinder::isContradicted() const {
  const double way_m = by_odometry_.mean.norm(), way_in_map = in_map_.mean.norm();
  const double variance = in_map_.covariance.trace() / (way_in_map * way_in_map) +
                          by_odometry_.covariance.trace() / (way_m * way_m);
  return variance < kKnownScale * kKnownScale &&
         in_map_.mean.dot(by_odometry_.mean) < kAgreement * way_m * way_in_map;
}

}  // namespace active_matching_slam
