#include "active_matching_slam/visualisation/submap_view.h"

#include <algorithm>
#include <unordered_map>

namespace active_matching_slam {

std::vector<int> submapsAtLevel(const TrackedFrame& frame, int level) {
  if (!frame.submaps || frame.submaps->levels.empty())
    return std::vector<int>(frame.features.size(), -1);
  std::vector<int> submaps;
  submaps.reserve(frame.features.size());
  const int last = static_cast<int>(frame.submaps->levels.size()) - 1;
  const SubmapLevel& chosen = frame.submaps->requested.submaps > 0
                                  ? frame.submaps->requested
                                  : frame.submaps->levels[std::clamp(level, 0, last)];
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

}  // namespace active_matching_slam
