// Submaps that are active and not yet proven to be where they were predicted.

#include <algorithm>
#include <utility>

#include "active_matching_slam/submaps/ekf_active_map.h"
#include "submap_keeper.h"

namespace active_matching_slam {

bool SubmapKeeper::isPinned(FeatureId id) const {
  if (tree_.isSeparator(id)) return true;
  if (!trial_) return false;
  const std::vector<FeatureId>& separator = trial_->leaf.points.given_ids;
  return std::find(separator.begin(), separator.end(), id) != separator.end();
}

bool SubmapKeeper::activateOnTrial(int leaf, double stamp_s, int most_features, Ekf* filter,
                                   FeatureMap* map) {
  const Leaf* found = tree_.find(leaf);
  if (trial_ || !found) return false;
  Trial trial;
  trial.leaf = *found;
  for (const FeatureId id : trial.leaf.points.ids) {
    trial.features.push_back(features_.at(id));
    trial.is_matched[id];
  }
  for (const FeatureId id : trial.leaf.points.given_ids) {
    if (filter->find(id)) continue;
    trial.rested.push_back(id);
    trial.is_matched[id];
  }
  if (!bringBack(leaf, stamp_s, most_features, filter, map)) return false;
  trial_ = std::move(trial);
  return true;
}

void SubmapKeeper::judgeTrial(const std::map<FeatureId, bool>& looked_for) {
  ++trial_->images;
  for (const auto& [id, is_matched] : looked_for) trial_->is_matched.at(id) = is_matched;
  std::size_t matched = 0, all = 0;
  for (const auto& [id, is_matched] : trial_->is_matched) {
    all += is_matched.has_value();
    matched += is_matched.value_or(false);
  }
  if (all < kLeastInView) return;
  if (2 * matched > all) {
    ++found_where_predicted_;
    countFound(trial_->leaf.points.ids);
    for (const auto& [id, is_matched] : trial_->is_matched) unsearched_.erase(id);
    trial_.reset();
  } else if (isTrialOver()) {
    ++missed_where_predicted_;
  }
}

void SubmapKeeper::putBack(double stamp_s, Ekf* filter, FeatureMap* map) {
  if (!trial_) return;
  const Trial trial = *std::exchange(trial_, std::nullopt);
  EkfActiveMap active(*filter);
  tree_.putBack(active, trial.leaf, trial.rested);
  exchange(stamp_s, filter, map);
  for (const MapFeature& feature : trial.features) features_.insert_or_assign(feature.id, feature);
  for (const auto& [id, is_matched] : trial.is_matched) unsearched_.erase(id);
  missed_.insert(trial.leaf.id);
}

}  // namespace active_matching_slam
