#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace active_matching_slam {

/// The value above a fraction, in [0, 1), of the others; 0 of none. None may be NaN.
inline double quantileOf(std::vector<double> values, double fraction) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The upper one of the two middle values when their number is even.
inline double medianOf(std::vector<double> values) { return quantileOf(std::move(values), 0.5); }

}  // namespace active_matching_slam
