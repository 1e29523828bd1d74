#include <algorithm>
#include <cmath>
#include <sstream>

#include "active_matching_slam/filter/scale_from_distances.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/math/chi_square.h"
#include "scale_acceptance.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Every how many frames a target is looked for. Cost: its detection takes as long as a frame.
constexpr int kDetectionPeriodFrames = 5;
/// Confidence up to which the corners have the target's shape. Cost: of a thousand sound sightings
/// one is begun anew.
constexpr double kShapeConfidence = 0.999;

}  // namespace

/// Corners of a known target join the map as features do; once their places in it are known, they
/// say how many metres a map unit is.
void Tracker::Implementation::followTarget(const cv::Mat& image, TrackedFrame* frame) {
  if (options_.target.kind == TargetDescription::Kind::kNone || !options_.mapping) return;
  // While the start is adjusted, each adjustment has a unit of its own.
  if (scale_source_ != ScaleSource::kFree && (target_.is_taken || target_.map != map_number_))
    return;
  const bool is_in_map = target_.map == map_number_ && !target_.corners.empty() &&
                         std::all_of(target_.corners.begin(), target_.corners.end(),
                                     [this](const TargetCorner& c) { return map_.find(c.id); });
  if (is_in_map) {
    scaleByTarget(frame);
  } else if (poor_frames_ == 0 && frame->index % kDetectionPeriodFrames == 0) {
    addTarget(image, frame);
  }
}

void Tracker::Implementation::addTarget(const cv::Mat& image, TrackedFrame* frame) {
  target_ = {};
  target_.map = map_number_;
  const TargetSighting seen = TargetDetector(options_.target).detect(image);
  const int count = static_cast<int>(seen.pixels.size());
  if (count == 0) return;
  std::vector<SourcePatch> patches;
  for (const Eigen::Vector2d& pixel : seen.pixels) {
    const auto patch = extractSourcePatch(image, pixel, filter_.camera().poseWorldCamera(),
                                          options_.image.source_patch_size_px);
    if (!patch) return;  // too near the border: it will be seen again
    patches.push_back(*patch);
  }
  retire(map_.leastUseful(filter_, map_.size() + count - options_.map.maximum_features), frame);
  const std::vector<DepthSample> known_depths = knownDepths(visibleFeatures());
  std::vector<FeatureMeasurement> first_sights;
  for (int i = 0; i < count; ++i) {
    const FeatureId id = addFeature(seen.pixels[i], patches[i], known_depths, frame->index);
    if (id < 0) continue;
    first_sights.push_back({id, seen.pixels[i], 0.0});
    target_.corners.push_back({id, seen.pixels[i], seen.positions_m[i]});
  }
  frame->features_started += static_cast<int>(first_sights.size());
  initialiser_.addFirstSights(first_sights);
  if (first_sights.size() < seen.pixels.size()) target_.corners.clear();
  target_.sigma_px = noise_.typicalSigma_px();
}

void Tracker::Implementation::scaleByTarget(TrackedFrame* frame) {
  std::vector<KnownDistance> distances;
  for (std::size_t i = 0; i < target_.corners.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const TargetCorner &a = target_.corners[i], &b = target_.corners[j];
      const double metres = (a.position_m - b.position_m).norm();
      const double metres_per_px = metres / (a.pixel - b.pixel).norm();
      distances.push_back({a.id, b.id, metres,
                           std::sqrt(2.0) * std::hypot(options_.known_points_sigma_m,
                                                       target_.sigma_px * metres_per_px)});
    }
  }
  const auto scale = estimateScale(filter_, distances);
  if (!scale || scale->sigma > kLargestScaleSigma) return;
  // Four points in a plane have as many distances as a shape and a size have parameters, and one.
  if (scale->chi2 > chiSquareQuantile(scale->degrees, kShapeConfidence)) {
    target_ = {};
    std::ostringstream fault;
    fault.precision(2);
    fault
        << "known_target is not used: what was taken for it has another shape than it should (its "
           "distances disagree with each other by chi2 = "
        << scale->chi2 << " of " << scale->degrees
        << "): are its kind, its size and the calibration right?";
    scale_fault_ = fault.str();
    return;
  }
  scale_fault_.clear();
  submaps_.openTrunk(&filter_);  // the scale is one of all lengths
  takeScale(*estimateScale(filter_, distances), &filter_);
  rescaleBesideFilter(scale->factor);
  submaps_.closeTrunk(&filter_);
  target_.is_taken = initialiser_.isDone();
  if (scale_source_ != ScaleSource::kFree) return;
  const bool is_tag = options_.target.kind == TargetDescription::Kind::kTag;
  scale_source_ = is_tag ? ScaleSource::kTag : ScaleSource::kChessboard;
  // Of another unit of length than the map before.
  target_.map = map_number_ = maps_begun_++;
  ++jumps_;
  frame->reason =
      std::string("lengths are metres from here on, by the ") + (is_tag ? "tag" : "chessboard");
}

}  // namespace active_matching_slam
