#include "active_matching_slam/information/submap_color.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {

Eigen::Vector3f submapRgb(int submap) {
  if (submap < 0) return Eigen::Vector3f::Constant(0.75f);
  // Steps of the golden ratio around the colour wheel keep neighbours in label far apart in hue.
  const double hue = 6.0 * std::fmod(0.08 + submap * 0.618033988749895, 1.0);
  const auto channel = [hue](double offset) {
    const double k = std::fmod(offset + hue, 6.0);
    return static_cast<float>(1.0 - 0.75 * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

}  // namespace active_matching_slam
