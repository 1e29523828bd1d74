#include "sampling.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace active_matching_slam {
namespace {

constexpr int kSteps = 256;         ///< of a pixel, between which weights are linear
constexpr double kSharpness = 5.5;  ///< of the window: below 5, waves of 8 pixels ripple

double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(M_PI * x) / (M_PI * x); }

double window(double x) {
  const double square = 1.0 - std::pow(x / (kTaps / 2), 2);
  return square > 0.0 ? std::cyl_bessel_i(0.0, kSharpness * std::sqrt(square)) : 0.0;
}

/// A row for each step from 0 to 1.
std::vector<float> makeTable() {
  std::vector<float> table;
  for (int step = 0; step <= kSteps; ++step) {
    double weights[kTaps], sum = 0.0;
    for (int k = 0; k < kTaps; ++k) {
      const double distance = static_cast<double>(step) / kSteps - (k - kTapsBefore);
      sum += weights[k] = sinc(distance) * window(distance);
    }
    for (const double weight : weights) table.push_back(static_cast<float>(weight / sum));
  }
  return table;
}

}  // namespace

void interpolationWeights(double x, float weights[kTaps]) {
  static const std::vector<float> table = makeTable();
  const double at = x * kSteps;
  const int step = std::clamp(static_cast<int>(at), 0, kSteps - 1);
  const auto fraction = static_cast<float>(at - step);
  const float* from = &table[step * kTaps];
  for (int k = 0; k < kTaps; ++k) weights[k] = from[k] + fraction * (from[k + kTaps] - from[k]);
}

}  // namespace active_matching_slam
