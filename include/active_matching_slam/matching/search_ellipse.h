#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// Squared Mahalanobis radius of a search ellipse: 3 sigma.
constexpr double kEllipseRadius2 = 9.0;
/// Mass of a Gaussian inside its own 3-sigma ellipse: 1 - exp(-9/2).
constexpr double kEllipseMass = 0.98889100346175773;

/// Whether a 2 x 2 covariance is finite, positive definite and not singular to rounding.
bool isProperCovariance(const Eigen::Matrix2d& covariance);

/// Whether the ellipse can be searched at all: finite centre, proper covariance.
bool isProperEllipse(const SearchEllipse& ellipse);

/// (p - center)^T covariance^-1 (p - center), for a proper ellipse.
double mahalanobisSquared(const SearchEllipse& ellipse, const Eigen::Vector2d& p);

/// Whether every point of `inner` lies in `outer` (closed; an equal ellipse is inside, with an
/// allowance of 1e-9 on the squared radius for rounding).
bool liesInside(const SearchEllipse& inner, const SearchEllipse& outer);

/// Whether the ellipse reaches beyond the box of pixels (each pixel a unit square).
bool reachesBeyond(const SearchEllipse& ellipse, const PixelBox& box);

/// Calls f(PixelRun) for each row of pixel centres inside the ellipse (closed) and the box, top to
/// bottom. Nothing is called for an improper ellipse. Coordinates are bounded by +-2^20, so that an
/// absurd covariance costs bounded work.
template <typename F>
void forEachEllipseRun(const SearchEllipse& ellipse, const PixelBox& box, F f) {
  if (!isProperEllipse(ellipse)) return;
  constexpr double kLimit = 1 << 20;
  const double xx = ellipse.covariance(0, 0), xy = ellipse.covariance(0, 1);
  const double yy = ellipse.covariance(1, 1), det = xx * yy - xy * xy;
  const double reach = std::sqrt(kEllipseRadius2 * yy);
  const double center_u = ellipse.center.x(), center_v = ellipse.center.y();
  const auto first = static_cast<int>(std::ceil(
      std::clamp<double>(std::max<double>(center_v - reach, box.min_v), -kLimit, kLimit)));
  const auto last = static_cast<int>(std::floor(
      std::clamp<double>(std::min<double>(center_v + reach, box.max_v), -kLimit, kLimit)));
  for (int v = first; v <= last; ++v) {
    const double dv = v - center_v;
    const double rest = kEllipseRadius2 * yy - dv * dv;
    if (rest < 0.0) continue;
    const double middle = center_u + xy / yy * dv, half = std::sqrt(det * rest) / yy;
    const double begin = std::max<double>(std::ceil(middle - half), box.min_u);
    const double end = std::min<double>(std::floor(middle + half), box.max_u);
    if (!(begin <= end) || begin > kLimit || end < -kLimit) continue;
    f(PixelRun{v, static_cast<int>(std::max(begin, -kLimit)),
               static_cast<int>(std::min(end, kLimit)) + 1});
  }
}

/// Number of pixel centres inside the ellipse and the box.
int countEllipsePixels(const SearchEllipse& ellipse, const PixelBox& box);

}  // namespace active_matching_slam
