#pragma once

#include <map>
#include <vector>

#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/submaps/submap_tree.h"

namespace active_matching_slam {

/// The frozen part of a map: its Gaussian, and what FeatureMap knew of each of its features.
class SubmapStore {
 public:
  SubmapTree& tree() { return tree_; }
  const SubmapTree& tree() const { return tree_; }

  /// Features, frozen or in the trunk, whose state is in tree(); those known already are replaced.
  void keep(std::vector<MapFeature> features);
  /// Hands features over to the active map again. Throws std::invalid_argument for an unknown one.
  std::vector<MapFeature> release(const std::vector<FeatureId>& ids);
  const MapFeature* find(FeatureId id) const;  ///< null when unknown
  const std::map<FeatureId, MapFeature>& features() const { return features_; }

  void clear();
  /// All lengths times `factor` > 0, as the filter has.
  void rescale(double factor);

 private:
  SubmapTree tree_;
  std::map<FeatureId, MapFeature> features_;
};

}  // namespace active_matching_slam
