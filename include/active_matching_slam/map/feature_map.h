#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_noise.h"
#include "active_matching_slam/image/patch.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/map/map_options.h"
#include "active_matching_slam/matching/feature_rate_statistics.h"

namespace active_matching_slam {

/// What the map knows of a feature beside its state in the filter.
struct MapFeature {
  FeatureId id = -1;
  SourcePatch patch;
  bool known = false;           ///< from a known target: never retired
  int attempts = 0;             ///< frames in which it was searched
  int successes = 0;            ///< of these, frames in which its match was accepted
  double recent_rate = 1.0;     ///< successes a search, averaged over about the last ten
  FeatureRateStatistics rates;  ///< learnt for the matchers
  /// Innovation less the frame's median, averaged over about the last ten matches [px].
  Eigen::Vector2d drift_px = Eigen::Vector2d::Zero();
  LandmarkNoise noise;  ///< of its matches
  /// What its match tells of the camera [bit], averaged over the last seconds; 0 in a frame in
  /// which it is not visible. Negative: not known yet.
  double information_bits = -1.0;
  bool behind_mask = false;  ///< should be seen in the last image, but not in the part in use
  std::int64_t first_frame = 0;
  std::int64_t last_matched_frame = 0;
};

/// A feature predicted to be visible in the present image.
struct VisibleFeature {
  FeatureId id = -1;
  PatchView view;
};

/// How a searched feature fared.
struct SearchRecord {
  FeatureId id = -1;
  bool matched = false;      ///< its match was accepted
  std::int64_t matches = 0;  ///< met in all, the accepted one included
  std::int64_t pixels = 0;   ///< searched
  Eigen::Vector2d innovation_px = Eigen::Vector2d::Zero();  ///< of the accepted match
};

/// Which features exist and which are searched. Means and covariances are the filter's; the two
/// hold the same ids at all times.
class FeatureMap {
 public:
  const std::vector<MapFeature>& features() const { return features_; }
  const MapFeature* find(FeatureId id) const;  ///< null when unknown
  int size() const { return static_cast<int>(features_.size()); }
  std::int64_t retiredTotal() const { return retired_total_; }

  void clear();
  void add(MapFeature feature);
  /// Forgets features that the filter has removed.
  void retire(const std::vector<FeatureId>& ids);
  /// Takes out features that go on elsewhere, by ascending id; they are not counted as retired.
  std::vector<MapFeature> take(const std::vector<FeatureId>& ids);
  /// Multiplies all lengths by `factor` > 0, as the filter has.
  void rescale(double factor);
  /// Puts the camera of each feature's first view at `moved(first_frame, T_world_camera)`.
  void movePatches(
      const std::function<Eigen::Isometry3d(std::int64_t, const Eigen::Isometry3d&)>& moved);

  /// Features predicted in front of the camera, inside the image less `border_px`, and neither too
  /// oblique nor too different in size from the first view, by flat views. Ascending id.
  std::vector<VisibleFeature> visible(const Ekf& filter, const CameraModel& camera,
                                      const MapOptions& options, double border_px) const;

  /// At most `wanted` of them, spread over the image: cells of a grid in turn, in each the features
  /// with the best record first. Ascending id. Known features always come along.
  std::vector<VisibleFeature> choose(const std::vector<VisibleFeature>& visible,
                                     const CameraModel& camera, int wanted) const;

  /// Counts a frame's searches. Where fewer than a third were matched, the image is at fault (blur,
  /// occlusion) and not the features, and it counts for the matched ones only.
  void record(const std::vector<SearchRecord>& searches, std::int64_t frame);

  /// Learns how the surface of a feature is inclined, from its match at `pixel` of `image`, where
  /// `expected` was searched.
  void learnSlope(const VisibleFeature& feature, const Template& expected, const cv::Mat& image,
                  const Eigen::Vector2d& pixel);

  /// Gives a feature a patch taken later. Ignores unknown ids.
  void retakePatch(FeatureId id, const SourcePatch& patch);

  /// LandmarkNoise::learn(). Ignores unknown ids.
  void learnNoise(FeatureId id, const Eigen::Vector2d& residual);

  /// How many of these features will probably be matched, by their recent record.
  double expectedMatches(const std::vector<VisibleFeature>& visible) const;

  /// Features that fail too often.
  std::vector<FeatureId> failing(const MapOptions& options) const;

  /// Features that are no points of the scene, such as corners where something near hides something
  /// far: their matches leave the prediction always to one side, by far more than others do.
  std::vector<FeatureId> drifting() const;

  /// Averages what the features that should be visible tell of the camera, `bits` of each, expected
  /// in a frame `interval_s` after the last. Of those `behind_mask` (ascending id) nothing can be
  /// said; the others tell nothing.
  void recordInformation(const std::vector<VisibleFeature>& visible,
                         const std::vector<double>& bits, const std::vector<FeatureId>& behind_mask,
                         double interval_s);

  /// The `count` features of least MapFeature::information_bits. Never a known one, nor one of
  /// which they are not known: yet, or because it is behind the mask.
  std::vector<FeatureId> leastInformative(int count) const;

  /// The `count` features of least use to the camera where it is: with the largest sum of the angle
  /// off the optical axis [rad], of the baseline from the first view over the distance (for a short
  /// one the angle [rad] by which the view of it has turned), and of the recent failure rate (0 to
  /// 1). A rule of thumb, each of the three about 1 where a feature is of no use any more; it
  /// measures no information. Never a known one.
  std::vector<FeatureId> leastUseful(const Ekf& filter, int count) const;

 private:
  MapFeature* findMutable(FeatureId id);  ///< null when unknown

  std::vector<MapFeature> features_;  ///< ascending id
  std::int64_t retired_total_ = 0;
};

}  // namespace active_matching_slam
