// The tree of submaps in the map's file, and as a frame describes it.

#include "active_matching_slam/submaps/ekf_active_map.h"
#include "submap_keeper.h"

namespace active_matching_slam {

void SubmapKeeper::save(const Ekf& filter, MapFileContent* content) const {
  if (tree_.empty()) return;
  Trunk trunk = tree_.trunk();
  trunk.refresh(activePoints(filter));
  if (!trunk.empty()) content->trunk = trunk.conditional();
  content->submaps = tree_.leaves();
  content->next_submap = tree_.nextLeaf();
  for (const auto& [id, feature] : features_) content->frozen.push_back(feature);
}

void SubmapKeeper::restore(const MapFileContent& content) {
  clear();
  if (content.frozen.empty()) return;
  tree_.restore(content.trunk, content.submaps, content.next_submap);
  for (const MapFeature& feature : content.frozen) features_.emplace(feature.id, feature);
  frozen_ = static_cast<int>(content.submaps.size());
}

std::shared_ptr<const FrozenMap> SubmapKeeper::describe(const Ekf& filter) const {
  auto description = std::make_shared<FrozenMap>();
  std::map<FeatureId, int> leaf_of;
  for (const Leaf& leaf : tree_.leaves()) {
    for (const FeatureId id : leaf.points.ids) leaf_of[id] = leaf.id;
    description->lost_bits += leaf.lost_bits;
    description->leaves.push_back({leaf.id, static_cast<int>(leaf.points.ids.size()),
                                   static_cast<int>(leaf.points.given_ids.size()), leaf.lost_bits});
  }
  for (const auto& [id, position] : positions(filter)) {
    const auto leaf = leaf_of.find(id);
    description->features.push_back(
        {id, leaf == leaf_of.end() ? -1 : leaf->second, isPinned(id), position});
  }
  for (const FeatureState& feature : filter.features())
    if (isPinned(feature.id)) description->active_separators.push_back(feature.id);
  description->submaps = static_cast<int>(tree_.leaves().size());
  description->trunk_features = static_cast<int>(tree_.trunk().ids().size());
  description->frozen = frozen_;
  description->found = found_;
  return description;
}

}  // namespace active_matching_slam
