#include "active_matching_slam/ros/submap_view.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace active_matching_slam {

std::vector<int> submapsAtLevel(const TrackedFrame& frame, int level) {
  if (!frame.submaps || frame.submaps->levels.empty())
    return std::vector<int>(frame.features.size(), -1);
  std::vector<int> submaps;
  submaps.reserve(frame.features.size());
  const int last = static_cast<int>(frame.submaps->levels.size()) - 1;
  const SubmapLevel& chosen = frame.submaps->levels[std::clamp(level, 0, last)];
  std::unordered_map<std::int64_t, int> submap_of_id;
  const std::size_t count = std::min(frame.submaps->ids.size(), chosen.submap_of_feature.size());
  for (std::size_t i = 0; i < count; ++i)
    submap_of_id[frame.submaps->ids[i]] = chosen.submap_of_feature[i];
  for (const TrackedFeature& feature : frame.features) {
    const auto found = submap_of_id.find(feature.id);
    submaps.push_back(found == submap_of_id.end() ? -1 : found->second);
  }
  return submaps;
}

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
