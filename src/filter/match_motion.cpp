#include "active_matching_slam/filter/match_motion.h"

#include <algorithm>

namespace active_matching_slam {

std::vector<double> matchMotions(const std::vector<FeatureMeasurement>& from,
                                 const std::vector<FeatureMeasurement>& to) {
  std::vector<double> lengths;
  auto before = from.begin();
  for (const FeatureMeasurement& match : to) {
    before = std::lower_bound(before, from.end(), match.id,
                              [](const FeatureMeasurement& m, FeatureId id) { return m.id < id; });
    if (before == from.end()) break;
    if (before->id == match.id) lengths.push_back((match.pixel - before->pixel).norm());
  }
  return lengths;
}

}  // namespace active_matching_slam
