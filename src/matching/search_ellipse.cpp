#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {

bool isProperCovariance(const Eigen::Matrix2d& covariance) {
  if (!covariance.allFinite()) return false;
  const double xx = covariance(0, 0), xy = covariance(0, 1), yy = covariance(1, 1);
  return xx > 0.0 && yy > 0.0 && xx * yy - xy * xy > 1e-12 * xx * yy;
}

bool isProperEllipse(const SearchEllipse& ellipse) {
  return ellipse.center.allFinite() && isProperCovariance(ellipse.covariance);
}

double mahalanobisSquared(const SearchEllipse& ellipse, const Eigen::Vector2d& p) {
  const double xx = ellipse.covariance(0, 0), xy = ellipse.covariance(0, 1);
  const double yy = ellipse.covariance(1, 1), det = xx * yy - xy * xy;
  const Eigen::Vector2d d = p - ellipse.center;
  return (yy * d.x() * d.x() - 2.0 * xy * d.x() * d.y() + xx * d.y() * d.y()) / det;
}

bool liesInside(const SearchEllipse& inner, const SearchEllipse& outer) {
  // In coordinates that make `outer` the unit circle, the border of `inner` is d + B n, |n| = 1,
  // and max |d + B n|^2 = min over t of h(t) = |d|^2 + t + sum_i w_i^2 / (t - e_i), with e_i the
  // eigenvalues of B^T B, w the components of B^T d along its eigenvectors, t > e_i (duality).
  constexpr double kLimit = 1.0 + 1e-9 / kEllipseRadius2;
  const double l00 = std::sqrt(outer.covariance(0, 0)), l10 = outer.covariance(1, 0) / l00;
  const double l11 = std::sqrt(outer.covariance(1, 1) - l10 * l10);
  const Eigen::Vector2d offset = inner.center - outer.center;
  const double dx = offset.x() / l00 / 3.0, dy = (offset.y() / 3.0 - l10 * dx) / l11;
  // B B^T = L^-1 S L^-T shares its eigenvalues with B^T B; |B^T d|^2 = d^T (B B^T) d.
  const double a = inner.covariance(0, 0) / (l00 * l00);
  const double b = (inner.covariance(1, 0) / l00 - l10 * a) / l11;
  const double c =
      (inner.covariance(1, 1) - 2.0 * l10 * inner.covariance(1, 0) / l00 + l10 * l10 * a) /
      (l11 * l11);
  const double half_sum = 0.5 * (a + c), swing = std::sqrt(0.25 * (a - c) * (a - c) + b * b);
  const double e1 = half_sum + swing, e2 = half_sum - swing, d2 = dx * dx + dy * dy;
  // Along the first eigenvector of B B^T, d has the squared component q1.
  const double quadratic = a * dx * dx + 2.0 * b * dx * dy + c * dy * dy;
  const double q1 = swing > 0.0 ? std::clamp((quadratic - e2 * d2) / (2.0 * swing), 0.0, d2) : d2;
  const double w1 = std::sqrt(std::max(e1 * q1, 0.0));
  const double w2 = std::sqrt(std::max(e2 * (d2 - q1), 0.0));
  if (d2 + e1 + 2.0 * std::sqrt(w1 * w1 + w2 * w2) <= kLimit) return true;
  if (d2 + e1 + 2.0 * w1 > kLimit) return false;  // n along the first eigenvector
  const auto ratio = [](double w, double gap) { return w > 0.0 ? w / gap : 0.0; };
  double t = e1 + std::max(w1, 1e-15 * e1);  // not beyond the minimum
  double h = 0.0;
  for (int i = 0; i < 30; ++i) {
    const double n1 = ratio(w1, t - e1), n2 = ratio(w2, t - e2);
    h = d2 + t + n1 * w1 + n2 * w2;
    if (h <= kLimit) return true;
    const double norm2 = n1 * n1 + n2 * n2, norm = std::sqrt(norm2);
    if (norm > 0.0 &&
        d2 + 2.0 * (w1 * n1 + w2 * n2) / norm + (e1 * n1 * n1 + e2 * n2 * n2) / norm2 > kLimit)
      return false;
    // Newton for |n(t)| = 1 in the form 1 / |n| = 1, which is almost linear in t.
    const double slope = ratio(n1 * n1, t - e1) + ratio(n2 * n2, t - e2);
    if (!(norm > 1.0 + 1e-15) || !(slope > 0.0)) break;
    t += norm2 * (norm - 1.0) / slope;
  }
  return h <= kLimit;
}

bool reachesBeyond(const SearchEllipse& ellipse, const PixelBox& box) {
  if (box.isUnbounded()) return false;
  const double reach_u = std::sqrt(kEllipseRadius2 * ellipse.covariance(0, 0));
  const double reach_v = std::sqrt(kEllipseRadius2 * ellipse.covariance(1, 1));
  return ellipse.center.x() - reach_u < box.min_u - 0.5 ||
         ellipse.center.x() + reach_u > box.max_u + 0.5 ||
         ellipse.center.y() - reach_v < box.min_v - 0.5 ||
         ellipse.center.y() + reach_v > box.max_v + 0.5;
}

int countEllipsePixels(const SearchEllipse& ellipse, const PixelBox& box) {
  int count = 0;
  forEachEllipseRun(ellipse, box, [&](const PixelRun& run) { count += run.end_u - run.begin_u; });
  return count;
}

}  // namespace active_matching_slam
