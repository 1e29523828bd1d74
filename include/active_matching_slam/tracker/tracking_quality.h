#pragma once

#include <string>

#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/filter_options.h"

namespace active_matching_slam {

/// What an image tells of whether the model that poses come from is right.
struct QualitySigns {
  int predicted = 0, matched = 0;  ///< features
  int rejected = 0;                ///< of those not matched: a match was met and not accepted
  /// A-posteriori variance of unit weight: by how much the residuals' variance exceeds what the
  /// fits of the templates promise; 0: unknown.
  double variance_factor = 0.0;
};

/// Whether poses can be trusted: the probability that the calibration is right and the scene stands
/// still, by a logistic regression on signs that are averaged over about a second.
/// doc/theory/quality.md
class TrackingQuality {
 public:
  void reset() { *this = TrackingQuality(); }
  /// An image, `interval_s` after the one before, and the calibration as corrected so far, whose
  /// prior has the standard deviations of the options.
  void add(double interval_s, const QualitySigns& signs, const CameraState& camera,
           const FilterOptions& options);
  double quality() const { return quality_; }  ///< 0 to 1; 1 until enough is known
  /// The likely cause of a low quality; else empty.
  const std::string& cause() const { return cause_; }

 private:
  double seconds_ = 0.0;                                        ///< of images so far
  double unmatched_ = 0.0, rejected_ = 0.0, log_factor_ = 0.0;  ///< averages
  double quality_ = 1.0;
  std::string cause_;
};

}  // namespace active_matching_slam
