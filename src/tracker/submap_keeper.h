#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <unordered_map>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/map/map_file.h"
#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/submaps/submap_filter_options.h"
#include "active_matching_slam/submaps/submap_tree.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// A feature that was laid aside and should be seen in the present image, if nothing hides it.
struct FrozenView {
  FeatureId id;
  int leaf;  ///< -1: of the trunk
  Eigen::Vector3d position_world;
  Eigen::Vector2d pixel;
};

/// What leaves the active map of a filter and is kept: the tree of submaps, what the map knew of
/// their features, and the rules by which features go and come. Active features, filter and map are
/// the tracker's. Whatever is kept stands in the same world and unit.
class SubmapKeeper {
 public:
  explicit SubmapKeeper(const SubmapFilterOptions& options) : options_(options) {}
  void setOptions(const SubmapFilterOptions& options) { options_ = options; }
  const SubmapFilterOptions& options() const { return options_; }
  bool isEnabled() const { return options_.enabled; }
  const SubmapTree& tree() const { return tree_; }
  const std::map<FeatureId, MapFeature>& features() const { return features_; }

  void clear();
  /// All lengths times `factor` > 0, as the filter has.
  void rescale(double factor);
  /// All of the trunk becomes active, or what of it is left goes back. Between the two the filter
  /// may be given a correction that all of the map has in common.
  void openTrunk(Ekf* filter);
  void closeTrunk(Ekf* filter);

  /// What is in view at `stamp_s`, or may be: behind the mask.
  void observe(const std::vector<VisibleFeature>& visible,
               const std::vector<FeatureId>& behind_mask, const FeatureMap& map, double stamp_s);

  /// Active features that stay, as separators or for another look, though they fail to match, and
  /// separators that have been out of view for a while: until a submap is found beside them.
  bool isUnsearched(FeatureId id) const {
    return unsearched_.count(id) > 0 || waiting_.count(id) > 0;
  }

  /// Of features that are to leave the map for good, those that may: the others are kept, and no
  /// longer searched. What is in the tree keeps what it knew through them.
  std::vector<FeatureId> remove(const std::vector<FeatureId>& ids, Ekf* filter,
                                const FeatureMap& map);
  bool isPinned(FeatureId id) const;

  /// Lays aside a submap of features that have been out of view for a while, where there are
  /// enough. Whether it did.
  bool layAside(double stamp_s, Ekf* filter, FeatureMap* map);
  /// Lets separators rest that have been out of view for a while.
  void restSeparators(double stamp_s, Ekf* filter, FeatureMap* map);

  /// Where features that were laid aside are now, by their separators. Ascending id.
  std::map<FeatureId, Eigen::Vector3d> positions(const Ekf& filter) const;
  /// Of these, what should be seen, by the rules of FeatureMap::visible().
  std::vector<FrozenView> visible(const std::map<FeatureId, Eigen::Vector3d>& positions,
                                  const Ekf& filter, const CameraModel& camera,
                                  const MapOptions& options, double border_px) const;

  /// The submap that may be searched as it is: enough of it should be in view, and it lies where it
  /// is predicted, relative to the camera. -1: none.
  int submapInView(const std::vector<FrozenView>& views, const Ekf& filter) const;
  /// Separators of the trunk for which the same holds, where it is worth the while: beside a submap
  /// that was found.
  std::vector<FeatureId> separatorsInView(const std::vector<FrozenView>& views,
                                          const Ekf& filter) const;
  /// Whether the submap that was found last is still in view.
  bool isPlaceKnown(const Ekf& filter, double stamp_s) const;
  /// Separators that wait are searched again.
  void searchWaiting() { waiting_.clear(); }
  /// Makes them active again. False, and nothing is changed, where the map, which may hold
  /// `most_features`, has no room for them.
  bool activate(int leaf, double stamp_s, int most_features, Ekf* filter, FeatureMap* map);
  /// The same of a submap of which no image has told yet that it is where it is predicted. In a
  /// wide gate chance makes matches too, and one that is followed from image to image would make
  /// the filter sure of a wrong pose. So it is on trial first: its features are searched and their
  /// matches are no measurements, until it is proven as the place of a lost camera is: of ten at
  /// least most match. One that is missed is put back as it was, and looked for. One at a time;
  /// meanwhile nothing is laid aside.
  bool activateOnTrial(int leaf, double stamp_s, int most_features, Ekf* filter, FeatureMap* map);
  bool hasTrial() const { return trial_.has_value(); }
  bool isOnTrial(FeatureId id) const { return trial_ && trial_->is_matched.count(id) > 0; }
  /// Which of its features were looked for in an image, and whether they matched.
  void judgeTrial(const std::map<FeatureId, bool>& looked_for);
  bool isTrialOver() const { return trial_ && trial_->images >= kTrialImages; }
  /// Ends a trial, if there is one: the submap is laid aside as it was, and counts as missed.
  void putBack(double stamp_s, Ekf* filter, FeatureMap* map);
  /// Separators of the trunk become active again.
  void activateSeparators(const std::vector<FeatureId>& ids, double stamp_s, Ekf* filter,
                          FeatureMap* map);

  /// At most `most` submaps that may be in view, as far as is known where they are, but not where
  /// they are predicted: those first that were not looked at for longest. Each is then not named
  /// again until the view has changed.
  std::vector<int> loopCandidates(const std::map<FeatureId, Eigen::Vector3d>& positions,
                                  const Ekf& filter, const CameraModel& camera,
                                  const MapOptions& options, int most);
  /// A submap was found but has to be seen once more: from the same place, too.
  void lookAgain(int leaf) { looked_from_.erase(leaf); }
  /// At most `most` submaps in turn, the newest first.
  std::vector<int> inTurn(int most);
  /// Features of a submap where they are now.
  std::vector<Landmark> landmarks(int leaf,
                                  const std::map<FeatureId, Eigen::Vector3d>& positions) const;
  /// Views of features were taken from elsewhere than was thought: by as much as each of them, at
  /// `before`, has been moved.
  void movePatches(const std::map<FeatureId, Eigen::Vector3d>& before, const Ekf& filter);
  /// A loop was closed: what did not match where it was predicted may now.
  void trust();
  /// Of the submaps that were on trial, so many were found, and so many missed.
  int foundWherePredicted() const { return found_where_predicted_; }
  int missedWherePredicted() const { return missed_where_predicted_; }

  /// As files keep it. The means are those of now.
  void save(const Ekf& filter, MapFileContent* content) const;
  /// Of a content that was checked.
  void restore(const MapFileContent& content);

  std::shared_ptr<const FrozenMap> describe(const Ekf& filter) const;

  /// A map may exceed its maximum by so many while nothing can be laid aside. Cost: time of a
  /// frame.
  static constexpr int kSlack = 30;

 private:
  /// Features of a submap in view, for it to be searched, and looked for, for it to be found or
  /// missed. Derivation: what a relocalisation must find (relocaliser/minimum_inliers).
  static constexpr std::size_t kLeastInView = 10;
  /// Images of a trial. Cost: one that is missed is looked for so much later.
  static constexpr int kTrialImages = 10;
  /// Separators that go to the trunk or come back together at least. Cost: each time is a
  /// factorisation of the map's covariance.
  static constexpr std::size_t kLeastSeparators = 4;

  void exchange(double stamp_s, Ekf* filter, FeatureMap* map);
  bool bringBack(int leaf, double stamp_s, int most_features, Ekf* filter, FeatureMap* map);
  void countFound(const std::vector<FeatureId>& ids);
  bool isResting(FeatureId id, double stamp_s) const;
  double relativeSigma(const Leaf& leaf, FeatureId middle, const PointGaussian& active,
                       const Ekf& filter) const;
  std::vector<FeatureId> candidates(double stamp_s, const Ekf& filter, const FeatureMap& map) const;

  struct Trial {
    Leaf leaf;
    std::vector<MapFeature> features;  ///< of the leaf, as they were
    std::vector<FeatureId> rested;     ///< of its separator, in the trunk before
    /// Of these features, whether they matched when they were last looked for; empty: they were
    /// not.
    std::map<FeatureId, std::optional<bool>> is_matched;
    int images = 0;
  };

  SubmapFilterOptions options_;
  SubmapTree tree_;
  std::map<FeatureId, MapFeature> features_;  ///< of the tree
  std::unordered_map<FeatureId, double> last_in_view_s_;
  std::set<FeatureId> unsearched_;        ///< failed to match, and stay
  std::set<FeatureId> waiting_;           ///< separators out of view for a while
  std::set<int> missed_;                  ///< leaves that were not where they were predicted
  std::vector<FeatureId> last_returned_;  ///< features of the submap that was found last
  std::optional<Trial> trial_;
  std::vector<FeatureId> opened_;
  /// Of each leaf by its id: standard deviation of its middle relative to the camera, when that was
  /// last asked for, and by which count of looks it was looked for.
  std::map<int, double> sigma_of_;
  std::map<int, int> looked_at_;
  std::map<int, Eigen::Isometry3d> looked_from_;  ///< in vain
  int looks_ = 0, next_in_turn_ = 0, next_sigma_ = 0;
  double last_freeze_s_ = -1e9, last_rest_s_ = -1e9;
  int least_resting_ = 0;  ///< features out of view, for a submap to be cut of them
  int frozen_ = 0, found_ = 0;
  int found_where_predicted_ = 0, missed_where_predicted_ = 0;
};

}  // namespace active_matching_slam
