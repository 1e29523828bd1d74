#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/image/image_quality.h"
#include "active_matching_slam/tracker/known_start.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Side of the smallest template of a known point. Standard: the least of image/template_size_px.
constexpr int kLeastTemplateSide = 5;
/// Standard deviation of the first camera, which is the world's frame. Derivation: 0, but that the
/// covariance stays positive definite [m, rad].
constexpr double kStartSigmaPosition = 1e-4, kStartSigmaRotation = 1e-4;

/// A known point, given as in an image of the camera, for one of the size at which it is tracked.
KnownPoint reducedPoint(KnownPoint point, const WorkingSize& working) {
  point.image_px = working.reduce(point.image_px);
  if (point.template_image.empty() || !working.isReduced()) return point;
  const int half = static_cast<int>(working.scale() * point.template_image.cols / 2);
  const int side = std::max(2 * half + 1, kLeastTemplateSide);
  cv::resize(cv::Mat(point.template_image), point.template_image, {side, side}, 0.0, 0.0,
             cv::INTER_AREA);
  return point;
}

}  // namespace

void Tracker::Implementation::start(const cv::Mat& image, TrackedFrame* frame) {
  if (!options_.mapping) {
    reason_ = "mapping is false, and no map has been loaded";
    return;
  }
  if (measureImageQuality(image).isBlank()) {
    state_ = TrackingState::kInitialising;
    reason_ = "the image is blank: nothing to start from";
    return;
  }
  map_.clear();
  map_monitor_.reset();
  if (!options_.known_points.empty()) {
    if (!startFromKnownPoints(image, frame)) return;
  } else {
    Eigen::Matrix<double, 12, 1> sigma;
    sigma << Eigen::Vector3d::Constant(kStartSigmaPosition),
        Eigen::Vector3d::Constant(kStartSigmaRotation),
        Eigen::Vector3d::Constant(options_.filter.initial_sigma_velocity_mps),
        Eigen::Vector3d::Constant(options_.filter.initial_sigma_angular_velocity_rps);
    filter_.reset(CameraState(), sigma.array().square().matrix().asDiagonal());
    scale_source_ = ScaleSource::kFree;
    scale_finder_.reset();
  }
  // Pose and covariance are relative to this image: it gives all the corners that it has, of which
  // each detection finds one a cell.
  for (int started = 1; started > 0; frame->features_started += started)
    started = startFeatures(image, {}, options_.map.features_per_frame - map_.size(), frame);
  initialiser_.end();
  if (options_.known_points.empty()) {
    filter_.fixScale(Ekf::kFreeScaleSigma);
    std::vector<FeatureMeasurement> first;
    for (const FeatureState& feature : filter_.features())
      if (const auto projection = projectFeature(camera_, filter_.camera(), feature))
        first.push_back({feature.id, projection->pixel, 0.0});
    initialiser_ = Initialiser(options_.initialisation);
    initialiser_.begin({frame->index, last_stamp_s_, first});
  }
  if (map_.size() < std::max(4, options_.minimum_matches)) {
    state_ = TrackingState::kInitialising;
    reason_ = "only " + std::to_string(map_.size()) + " corners to start from";
    return;
  }
  state_ = TrackingState::kTracking;
  reason_.clear();
  poor_frames_ = 0;
}

/// Lets the first images, taken together, correct what the filter made of them one by one. True
/// when this image became the first instead.
bool Tracker::Implementation::initialise(const FrameState& current, TrackedFrame* frame) {
  if (initialiser_.isDone()) {
    unrelated_images_ = 0;
    return false;
  }
  const CameraModel calibrated = camera_.corrected({});
  initialiser_.add(calibrated, {frame->index, last_stamp_s_, current.measurements}, filter_,
                   current.countLookedFor());
  if (initialiser_.isFirstUnrelated()) {
    start(current.image, frame);
    ++resets_;
    ++jumps_;
    ++unrelated_images_;
    frame->reason = "the first image has nothing to do with the second: started anew from it";
    return true;
  }
  unrelated_images_ = 0;
  initialiser_.expect(motion_noise_.expected());
  const auto initial = initialiser_.step(calibrated, filter_);
  if (!initial) return false;
  std::vector<FeatureId> dropped;  // too few measurements to take part
  auto kept = initial->features.begin();
  for (const MapFeature& feature : map_.features()) {
    if (kept != initial->features.end() && kept->id == feature.id) {
      ++kept;
    } else {
      dropped.push_back(feature.id);
    }
  }
  retire(dropped, frame);
  map_.movePatches([&initial](std::int64_t image, const Eigen::Isometry3d& T_world_camera) {
    return initial->corrected(image, T_world_camera);
  });
  filter_.restore(initial->camera, initial->features, initial->covariance, filter_.nextId());
  if (initial->is_first) structure_.restartAverages();
  return false;
}

bool Tracker::Implementation::startFromKnownPoints(const cv::Mat& image, TrackedFrame* frame) {
  std::vector<KnownPoint> points = options_.known_points;
  for (KnownPoint& point : points) point = reducedPoint(point, working_);
  const auto found =
      findKnownStart(image, camera_, points, working_.scale() * options_.known_points_search_px,
                     options_.image, &reason_);
  if (!found) {
    state_ = TrackingState::kInitialising;
    return false;
  }
  CameraState camera;
  camera.setPoseWorldCamera(found->T_world_camera);
  // The pose is linearised at its solution and all but free (as far off as the target is, and a
  // tenth of a metre for one that is very near): the points alone determine it below.
  const double distance = camera.position_world.norm() + 0.1;
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << Eigen::Vector3d::Constant(distance), Eigen::Vector3d::Constant(1.0),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_velocity_mps),
      Eigen::Vector3d::Constant(options_.filter.initial_sigma_angular_velocity_rps);
  filter_.reset(camera, sigma.array().square().matrix().asDiagonal());
  const double variance_m2 = options_.known_points_sigma_m * options_.known_points_sigma_m;
  std::vector<FeatureMeasurement> measurements;
  for (std::size_t i = 0; i < options_.known_points.size(); ++i) {
    MapFeature feature;
    feature.id = filter_.addPointFeature(options_.known_points[i].position_m,
                                         variance_m2 * Eigen::Matrix3d::Identity());
    feature.known = true;
    feature.first_frame = frame->index;
    measurements.push_back({feature.id, found->pixels[i], 0.0});
    const auto patch = extractSourcePatch(image, found->pixels[i], found->T_world_camera,
                                          options_.image.source_patch_size_px);
    if (!patch) {
      reason_ = "known point " + std::to_string(i) + " is too close to the image border";
      state_ = TrackingState::kInitialising;
      return false;
    }
    feature.patch = *patch;
    map_.add(std::move(feature));
  }
  filter_.update(camera_, measurements);
  scale_source_ =
      options_.known_points.size() == 4 ? ScaleSource::kKnownTarget : ScaleSource::kKnownPoints;
  return true;
}

}  // namespace active_matching_slam
