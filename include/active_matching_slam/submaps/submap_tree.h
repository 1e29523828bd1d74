#pragma once

#include <map>
#include <vector>

#include "active_matching_slam/submaps/active_map.h"
#include "active_matching_slam/submaps/conditional.h"
#include "active_matching_slam/submaps/trunk.h"

namespace active_matching_slam {

/// A frozen submap: points given a few others, its separator, which lie in the active map or in the
/// trunk.
struct Leaf {
  int id = -1;           ///< never reused
  Conditional points;    ///< p(x_J | x_C); given_ids: the separator C
  double lost_bits = 0;  ///< I(J; rest | C) when it was frozen [bit]
};

struct FreezeOptions {
  int separator = 10;            ///< points of a separator at most
  double enough_bits = 1.0;      ///< fewer points suffice when no more is lost [bit]
  double preference_bits = 0.5;  ///< bits that keeping a present separator may cost, a point
  /// Points of the trunk, nearest to J, of which the choice of the separator takes note.
  int trunk_neighbours = 60;
  /// What the dropped link knew is given back as variance; false: the link is simply dropped.
  bool conservative = true;
};

/// The filter on the tree of submaps: active map, trunk and leaves, and how points move between
/// them. Each leaf hangs on its separator, each separator is active or in the trunk, and the trunk
/// hangs on the active map.
class SubmapTree {
 public:
  const Trunk& trunk() const { return trunk_; }
  const std::vector<Leaf>& leaves() const { return leaves_; }  ///< ascending id
  const Leaf* find(int id) const;                              ///< null when unknown
  /// Of the leaf that holds a point; null when none does.
  const Leaf* leafOf(FeatureId id) const;
  /// Points in the separator of a leaf, active or in the trunk: they are not to be removed.
  bool isSeparator(FeatureId id) const { return separators_.count(id) > 0; }
  /// Points in trunk and leaves.
  int frozenCount() const;
  bool empty() const { return leaves_.empty() && trunk_.empty(); }

  void clear();
  /// Saved contents. Throws std::invalid_argument naming what does not fit together.
  void restore(const Conditional& trunk, const std::vector<Leaf>& leaves, int next_leaf);
  int nextLeaf() const { return next_leaf_; }

  /// The separator that freeze() would take for `points`, active ones that are no separators; those
  /// of `points` that the separator takes are not frozen. `bits`: what would be lost.
  std::vector<FeatureId> chooseSeparator(const ActiveMap& active,
                                         const std::vector<FeatureId>& points,
                                         const FreezeOptions& options, double* bits) const;

  /// Makes a leaf of active points, separated from the rest by `separator` (active or in the
  /// trunk); those of the separator that are in `resting` go to the trunk. Returns its id.
  /// Points in `separator` are left out of `points`.
  int freeze(ActiveMap& active, const std::vector<FeatureId>& points,
             const std::vector<FeatureId>& separator, const std::vector<FeatureId>& resting,
             const FreezeOptions& options);

  /// A leaf and its separator back into the active map; the leaf is no more. Returns its points.
  std::vector<FeatureId> activate(ActiveMap& active, int leaf);

  /// What activate() returned as it was, where nothing of it was measured since: exact, for its
  /// points depend on the rest by the separator alone. `resting`: of the separator, back to the
  /// trunk. In between the separator must neither leave nor be frozen.
  void putBack(ActiveMap& active, const Leaf& leaf, const std::vector<FeatureId>& resting);

  /// Points of the trunk back into the active map.
  void activateTrunk(ActiveMap& active, const std::vector<FeatureId>& ids);

  /// Active points to the trunk: separators out of view.
  void rest(ActiveMap& active, const std::vector<FeatureId>& ids);

  /// Active points vanish for good: what the trunk knew through them it keeps. Not separators.
  void remove(ActiveMap& active, const std::vector<FeatureId>& ids);

  /// A leaf's points given the active map, p(x_J | x_M): where they should be seen, how well that
  /// is known, and by P_J. = K P_M. also in relation to the camera.
  Conditional givenActive(const PointGaussian& active, const Leaf& leaf) const;
  /// Points of the trunk likewise.
  Conditional givenActive(const PointGaussian& active, const std::vector<FeatureId>& ids) const;

  /// All lengths times `factor` > 0, as the filter has.
  void rescale(double factor);

 private:
  void pin(const Leaf& leaf, int count);

  Trunk trunk_;
  std::vector<Leaf> leaves_;
  std::map<FeatureId, int> separators_;  ///< of how many leaves
  int next_leaf_ = 0;
};

}  // namespace active_matching_slam
