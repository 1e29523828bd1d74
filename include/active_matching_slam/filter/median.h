#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace active_matching_slam {

/// The upper one of the two middle values when their number is even; 0 of none. None may be NaN.
inline double medianOf(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace active_matching_slam
