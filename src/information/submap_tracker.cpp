#include "active_matching_slam/information/submap_tracker.h"

#include <algorithm>
#include <set>
#include <tuple>

namespace active_matching_slam {
namespace {

/// Labels per cluster of `level`, -1 where none of the old ones is left for it.
std::vector<int> matchLabels(const std::vector<std::int64_t>& ids, const SubmapLevel& level,
                             const std::map<std::int64_t, int>& old_labels) {
  std::map<std::pair<int, int>, int> shared;  // (old label, cluster) -> features
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto old = old_labels.find(ids[i]);
    if (old != old_labels.end()) ++shared[{old->second, level.submap_of_feature[i]}];
  }
  std::vector<std::tuple<int, int, int>> overlaps;  // (-features, old label, cluster)
  overlaps.reserve(shared.size());
  for (const auto& [key, features] : shared) {
    overlaps.emplace_back(-features, key.first, key.second);
  }
  std::sort(overlaps.begin(), overlaps.end());
  std::vector<int> label_of_cluster(level.submaps, -1);
  std::set<int> given;
  for (const auto& [features, label, cluster] : overlaps) {
    if (label_of_cluster[cluster] < 0 && given.insert(label).second) {
      label_of_cluster[cluster] = label;
    }
  }
  return label_of_cluster;
}

void relabelLevel(const std::vector<std::int64_t>& ids, SubmapLevel* level,
                  std::map<std::int64_t, int>* labels) {
  std::vector<int> label_of_cluster = matchLabels(ids, *level, *labels);
  std::set<int> taken;
  for (const auto& old : *labels) taken.insert(old.second);
  int next = 0;
  for (int& label : label_of_cluster) {
    if (label >= 0) continue;
    while (taken.count(next) > 0) ++next;
    label = next++;
  }
  labels->clear();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    level->submap_of_feature[i] = label_of_cluster[level->submap_of_feature[i]];
    labels->emplace_hint(labels->end(), ids[i], level->submap_of_feature[i]);
  }
}

}  // namespace

void SubmapTracker::relabel(SubmapHierarchy& hierarchy) {
  if (labels_.size() < hierarchy.levels.size()) labels_.resize(hierarchy.levels.size());
  for (std::size_t h = 0; h < hierarchy.levels.size(); ++h)
    relabelLevel(hierarchy.ids, &hierarchy.levels[h], &labels_[h]);
  if (hierarchy.requested.submaps > 0)
    relabelLevel(hierarchy.ids, &hierarchy.requested, &requested_);
}

void SubmapTracker::clear() {
  labels_.clear();
  requested_.clear();
}

}  // namespace active_matching_slam
