#pragma once

#include <functional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/match_noise.h"
#include "active_matching_slam/map/feature_map.h"

namespace active_matching_slam {

/// All that the tracker has to do with the noise of matches: what each match's is, what updates
/// teach about it, and the process noise of landmarks, which goes by it.
class FrameNoise {
 public:
  void reset() { *this = FrameNoise(); }

  /// Adds the landmarks' process noise of `interval_s`. After Ekf::predict().
  void addProcessNoise(const CameraModel& camera, double interval_s, const FeatureMap& map,
                       Ekf* filter) const;

  /// Standard deviation per axis [px] that gates and matchers allow a match: an upper bound, since
  /// that is before anything is known of the image.
  static double gateSigma_px(const FilterOptions& options) { return options.sigma_px; }

  /// Sets the noise of the measurements of one image, ascending by id. They come with the sigma of
  /// their template's fit (SearchMatch::sigma_px). `is_adjusted`: whether the initialiser will use
  /// a feature's matches once more.
  void weigh(const FilterOptions& options, const std::function<bool(FeatureId)>& is_adjusted,
             FeatureMap* map, std::vector<FeatureMeasurement>* measurements);

  /// Learns from what the update by these measurements left over.
  void learn(const UpdateReport& report, const std::vector<FeatureMeasurement>& measurements,
             FeatureMap* map);

  /// Median standard deviation of matches in the present image, per axis [px].
  double typicalSigma_px(const FilterOptions& options) const {
    return match_noise_.sigma_px(options);
  }

 private:
  MatchNoise match_noise_;
  std::vector<FeatureMeasurement> last_;  ///< measurements of the image weighed before
};

}  // namespace active_matching_slam
