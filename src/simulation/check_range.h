#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace active_matching_slam {

/// Throws std::invalid_argument "<name> is <value>, must be in [low, high]"; NaN is out of any
/// range.
template <typename T>
void checkRange(const std::string& name, T value, T low, T high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << name << " is " << value << ", must be in [" << low << ", " << high << "]";
  throw std::invalid_argument(text.str());
}

}  // namespace active_matching_slam
