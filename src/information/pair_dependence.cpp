#include "active_matching_slam/information/pair_dependence.h"

namespace active_matching_slam {

Whitening Whitening::of(double s00, double s10, double s11) {
  // Below this fraction of its variance a coordinate counts as determined by the other one.
  constexpr double kSmallestFraction = 1e-14;
  Whitening w;
  if (!(std::isfinite(s00) && std::isfinite(s10) && std::isfinite(s11) && s00 > 0.0)) return w;
  const double left = s11 - s10 / s00 * s10;
  if (!(left > kSmallestFraction * s11)) return w;
  w.a = 1.0 / std::sqrt(s00);
  w.c = 1.0 / std::sqrt(left);
  w.b = -s10 / s00 * w.c;
  w.usable = true;
  return w;
}

}  // namespace active_matching_slam
