#pragma once

namespace active_matching_slam {

/// Weights of the four samples at -1, 0, 1, 2 for a position `x` in [0, 1]: cubic convolution with
/// a = -1/2 (Keys 1981), exact for parabolas.
template <typename Real>
void cubicWeights(double x, Real weights[4]) {
  weights[0] = static_cast<Real>(((-0.5 * x + 1.0) * x - 0.5) * x);
  weights[1] = static_cast<Real>((1.5 * x - 2.5) * x * x + 1.0);
  weights[2] = static_cast<Real>(((-1.5 * x + 2.0) * x + 0.5) * x);
  weights[3] = static_cast<Real>((0.5 * x - 0.5) * x * x);
}

}  // namespace active_matching_slam
