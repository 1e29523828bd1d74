#include "recording.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "active_matching_slam/math/pixel_scale.h"
#include "active_matching_slam/tracker/tracker.h"
#include "reference_matcher.h"

namespace active_matching_slam {

TrackerOptions referenceOptions(const Sequence& sequence, int features) {
  TrackerOptions options;
  options.matching.max_milliseconds = 0.0;  // matchers are compared by what they do, not when cut
  options.matcher = "active";
  options.filter.sigma_acceleration_mps2 = sequence.sigma_acceleration;
  options.filter.sigma_angular_acceleration_rps2 = sequence.sigma_angular_acceleration;
  options.map.features_per_frame = features;
  options.map.maximum_features = features + features / 2 + 20;
  // Room for so many, and corners that are none too good, as section 7.5 has them.
  const int width = sequence.camera.width(), height = sequence.camera.height();
  options.image.working_width = std::max(options.image.working_width, width);
  const double distance_px = std::sqrt(double(width) * height / (4.0 * features));
  options.map.minimum_distance_px = std::clamp(distance_px, 6.0, 20.0) / pixelScale(width, height);
  options.image.corner_quality = 0.05;
  return options;
}

void trackSequence(const Sequence& sequence, const TrackerOptions& options, int every,
                   const std::function<void(const TrackedFrame&, int)>& observe) {
  Tracker tracker(sequence.camera, options);
  for (const int i : imagesAtRate(static_cast<int>(sequence.images.size()), every)) {
    const auto slot = static_cast<std::size_t>(i);
    observe(*tracker.track(sequence.images[slot], sequence.stamps_s[slot]), i);
  }
}

bool hasKnownDepth(const TrackedFeature& feature) {
  return feature.kind == FeatureKind::kPoint ||
         feature.sigma_inverse_depth < 0.2 * feature.inverse_depth;
}

void TruePlaces::observe(const TrackedFrame& frame, int image) {
  const Eigen::Isometry3d T_camera_world = frame.camera.poseWorldCamera().inverse();
  const Eigen::Isometry3d& T_world_camera_true =
      sequence_.truth[static_cast<std::size_t>(image)].T_world_camera;
  for (const TrackedFeature& feature : frame.features) {
    if (point_world_.count(feature.id)) continue;
    const auto pixel = sequence_.camera.project(T_camera_world * feature.position_world);
    const auto bearing = pixel ? sequence_.camera.unproject(*pixel) : std::nullopt;
    point_world_[feature.id] = bearing
                                   ? firstHit(sequence_.surfaces, T_world_camera_true.translation(),
                                              T_world_camera_true.linear() * *bearing)
                                   : std::nullopt;
  }
}

Eigen::Vector2d TruePlaces::pixel(FeatureId id, int image) const {
  constexpr double kSamePoint = 0.01;  // of the distance
  const auto at = point_world_.find(id);
  if (at == point_world_.end() || !at->second) return unknownPixel();
  const Eigen::Isometry3d& T_world_camera =
      sequence_.truth[static_cast<std::size_t>(image)].T_world_camera;
  const auto pixel = sequence_.camera.project(T_world_camera.inverse() * *at->second);
  if (!pixel || !sequence_.camera.isInImage(*pixel)) return unknownPixel();
  const Eigen::Vector3d ray = *at->second - T_world_camera.translation();
  const auto seen = firstHit(sequence_.surfaces, T_world_camera.translation(), ray.normalized());
  if (!seen || (*seen - *at->second).norm() > kSamePoint * ray.norm()) return unknownPixel();
  return *pixel;
}

Recording recordProblems(const Sequence& sequence, const RecordingOptions& options) {
  const std::vector<int> images =
      imagesAtRate(static_cast<int>(sequence.images.size()), options.every);
  std::vector<int> at_rate;
  for (const int i : images)
    if (i > kFullRateFrames) at_rate.push_back(i);
  std::set<int> wanted;
  const int count = static_cast<int>(at_rate.size());
  for (int k = 0; k < std::min(options.problems, count); ++k)
    wanted.insert(at_rate[static_cast<std::size_t>(k * count / std::min(options.problems, count))]);

  TrackerOptions tracker_options = referenceOptions(sequence, options.features);
  tracker_options.image.template_size_px = options.template_size_px;
  tracker_options.image.source_patch_size_px =
      std::max(tracker_options.image.source_patch_size_px, 2 * options.template_size_px + 1);
  tracker_options.image.border_px =
      std::max(tracker_options.image.border_px, options.template_size_px / 2 + 2);

  Recording recording;
  TruePlaces truth(sequence);
  ReferenceMatcher reference(sequence);
  trackSequence(sequence, tracker_options, options.every, [&](const TrackedFrame& frame, int i) {
    ++recording.frames;
    const bool is_tracked = frame.state == TrackingState::kTracking;
    recording.tracked += is_tracked;
    if (sequence.isSimulated())
      truth.observe(frame, i);
    else
      reference.observe(frame, i);
    if (!is_tracked || !wanted.count(i) || frame.prior.size() == 0) return;
    RecordedProblem problem;
    problem.image = i;
    problem.prior = frame.prior;
    problem.prior.rates.clear();
    problem.prior.wide_probability = 0.0;
    problem.prior.wide_S.resize(0, 0);
    problem.templates = frame.templates;
    problem.other_ms = frame.timings_ms.predict + frame.timings_ms.measure +
                       frame.timings_ms.update + frame.timings_ms.map;
    if (sequence.isSimulated())
      for (const FeatureId id : problem.prior.ids)
        problem.reference_px.push_back(truth.pixel(id, i));
    recording.problems.push_back(std::move(problem));
  });
  if (!sequence.isSimulated())
    for (RecordedProblem& problem : recording.problems)
      problem.reference_px = reference.match(problem.image, problem.prior.ids, problem.templates);
  return recording;
}

}  // namespace active_matching_slam
