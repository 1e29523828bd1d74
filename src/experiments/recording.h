#pragma once

#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "active_matching_slam/image/template.h"
#include "active_matching_slam/matching/measurement_prior.h"
#include "active_matching_slam/tracker/tracked_frame.h"
#include "sequence.h"

namespace active_matching_slam {

/// One frame's matching problem, written down once in a reference run, so that every matcher gets
/// the same input and none changes that of another.
struct RecordedProblem {
  int image = 0;           ///< index into the sequence
  MeasurementPrior prior;  ///< uniform rates, one Gaussian
  std::vector<Template> templates;
  /// Where each feature is, by the truth of the simulator or by the reference matcher; NaN where
  /// that is not known, or the feature hidden or out of the image [px].
  std::vector<Eigen::Vector2d> reference_px;
  double other_ms = 0.0;  ///< what the tracker did for this frame beside matching
};

struct RecordingOptions {
  int every = 1;       ///< of the 30 images a second
  int features = 100;  ///< measured in a frame
  int problems = 20;   ///< how many frames are kept, evenly spread
  int template_size_px = 11;
};

struct Recording {
  std::vector<RecordedProblem> problems;
  int frames = 0, tracked = 0;  ///< of the reference run
};

/// Settings of the reference run: Active Matching, as many features as asked for, the sequence's
/// accelerations.
TrackerOptions referenceOptions(const Sequence& sequence, int features);

/// Tracks the images a camera of 30 / every Hz would take.
void trackSequence(const Sequence& sequence, const TrackerOptions& options, int every,
                   const std::function<void(const TrackedFrame&, int image)>& observe);

Recording recordProblems(const Sequence& sequence, const RecordingOptions& options);

/// True places of features in a simulated sequence: the surface point that a feature's first ray
/// meets, seen by the true camera.
class TruePlaces {
 public:
  explicit TruePlaces(const Sequence& sequence) : sequence_(sequence) {}
  /// To be shown every frame: notes the features that are new in it.
  void observe(const TrackedFrame& frame, int image);
  /// NaN when the feature met nothing, is hidden or out of the image.
  Eigen::Vector2d pixel(FeatureId id, int image) const;

 private:
  const Sequence& sequence_;
  std::map<FeatureId, std::optional<Eigen::Vector3d>> point_world_;
};

/// A feature's depth is known well enough for its position to mean something.
bool hasKnownDepth(const TrackedFeature& feature);

inline Eigen::Vector2d unknownPixel() { return Eigen::Vector2d::Constant(std::nan("")); }

}  // namespace active_matching_slam
