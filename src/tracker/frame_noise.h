#pragma once

#include <functional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_noise.h"
#include "active_matching_slam/map/feature_map.h"

namespace active_matching_slam {

/// Noise of the tracker's landmarks and matches: process noise of the former, R of the latter,
/// which is learnt from the updates' residuals (MeasurementNoise).
class FrameNoise {
 public:
  explicit FrameNoise(const FilterOptions& options) : options_(options), noise_(options) {}
  void setOptions(const FilterOptions& options);
  void reset() { noise_.reset(); }

  /// Adds the landmarks' process noise of `interval_s` to `filter` (null: to none). After
  /// Ekf::predict().
  void predict(const CameraModel& camera, double interval_s, Ekf* filter);

  /// Standard deviation per axis [px] that gates and matchers allow a match of `feature`.
  double gateSigma_px(const MapFeature& feature) const {
    return noise_.gateSigma_px(feature.noise);
  }

  /// Sets R of the measurements of one image, which come with the sigma of their template's fit
  /// (SearchMatch::sigma_px). `is_adjusted`: whether a feature's matches take part in the bundle
  /// adjustment of the first images as well.
  void weigh(const std::function<bool(FeatureId)>& is_adjusted, const FeatureMap& map,
             std::vector<FeatureMeasurement>* measurements);

  /// Prior of the variance factor common to these measurements.
  NoisePrior prior() const;

  /// Learns from the post-fit residuals of the measurements weighed last.
  void learn(const UpdateReport& report, const std::vector<FeatureMeasurement>& measurements,
             FeatureMap* map);

  /// Standard deviation per axis [px] of a typical match in the last image.
  double typicalSigma_px() const { return noise_.typicalSigma_px(); }
  /// MeasurementNoise::varianceFactor().
  double varianceFactor() const { return noise_.varianceFactor(); }

 private:
  FilterOptions options_;
  MeasurementNoise noise_;
  std::vector<FitPrecision> fits_;  ///< of the measurements weighed last
};

}  // namespace active_matching_slam
