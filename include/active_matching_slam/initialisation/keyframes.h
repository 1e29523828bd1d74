#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/initialisation/bundle_adjustment.h"
#include "active_matching_slam/initialisation/initialiser_options.h"

namespace active_matching_slam {

/// The matches of an image.
struct KeyframeMeasurements {
  std::int64_t image = 0;
  double stamp_s = 0.0;
  std::vector<FeatureMeasurement> measurements;  ///< ascending id
};

struct Keyframe : KeyframeMeasurements {
  /// Where the filter had the camera; after a commit, where that put it.
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  Eigen::Quaterniond q_rotation_only = Eigen::Quaterniond::Identity();  ///< if nothing translated
  /// Image velocity [px/s] of each measurement, by the images next to this one; zero: unknown.
  std::vector<Eigen::Vector2d> velocities_px_s;

  const FeatureMeasurement* find(FeatureId id) const;
};

/// A bundle of some keyframes.
struct MotionHypothesis {
  Bundle bundle;
  std::vector<FeatureId> ids;        ///< of its features, ascending
  std::vector<std::int64_t> images;  ///< of its cameras, ascending
};

/// The images that take part in an initialisation: the first, the last two, and between them those
/// that add motion, bounded in number.
class Keyframes {
 public:
  explicit Keyframes(const InitialiserOptions& options) : options_(options) {}

  void begin(KeyframeMeasurements first);
  /// False, and nothing changes, when the image shares too few points with the one before.
  bool add(const CameraModel& model, KeyframeMeasurements image,
           const Eigen::Isometry3d& T_world_camera);
  /// Joins features that the last keyframe saw first, numbered above all before.
  void addFirstSights(const std::vector<FeatureMeasurement>& measurements);
  /// The first keyframes go while the last two share too few points with them; at least two remain.
  void dropUnseen();
  void rescale(double factor);

  int size() const { return static_cast<int>(keyframes_.size()); }
  std::vector<Keyframe>& all() { return keyframes_; }
  const std::vector<Keyframe>& all() const { return keyframes_; }
  bool sharesFirst() const;  ///< whether the last sees enough of what the first saw

  /// Largest parallax [rad] of the last keyframe to some of those before that share enough points
  /// with it: the angle between rays that no rotation explains, of three quarters of the points;
  /// of noise alone it is about the noise's median. Empty when none does.
  std::optional<double> parallax(const CameraModel& model) const;
  /// Few keyframes as if the camera had only rotated; the rotations are kept. Empty when they do
  /// not hang together.
  std::optional<MotionHypothesis> rotationOnly(const CameraModel& model) const;
  /// All keyframes: cameras and features of `known` where it has them, other cameras by constant
  /// velocity, other features at the median depth. Empty when they do not hang together.
  std::optional<MotionHypothesis> extend(const CameraModel& model,
                                         const MotionHypothesis& known) const;

 private:
  void cull(const CameraModel& model);
  void placeCameras(const CameraModel& model, const MotionHypothesis& known,
                    const std::vector<bool>& is_known, MotionHypothesis* all) const;
  MotionHypothesis observationsOf(const CameraModel& model, const std::vector<int>& chosen) const;
  bool isConnected(const Bundle& bundle) const;

  InitialiserOptions options_;
  std::vector<Keyframe> keyframes_;
  double minimum_motion_deg_ = 0.0;
};

}  // namespace active_matching_slam
