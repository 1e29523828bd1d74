#include "active_matching_slam/math/chi_square.h"

#include <cmath>

namespace active_matching_slam {
namespace {

/// P(chi-square of 2n degrees of freedom > x) = exp(-x/2) sum_{j<n} (x/2)^j / j!, summed from the
/// last term, which logarithms keep finite.
double upperTail(int n, double x) {
  if (x <= 0.0) return 1.0;
  double term = std::exp(-0.5 * x + (n - 1) * std::log(0.5 * x) - std::lgamma(n)), sum = term;
  for (int j = n - 1; j > 0; --j) {
    term *= j / (0.5 * x);
    sum += term;
  }
  return sum;
}

}  // namespace

double chiSquareQuantile(int pairs, double probability) {
  double low = 0.0, high = 2.0 * pairs;
  while (upperTail(pairs, high) > 1.0 - probability) high *= 1.5;
  for (int i = 0; i < 100 && low < high; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) break;
    (upperTail(pairs, middle) > 1.0 - probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace active_matching_slam
