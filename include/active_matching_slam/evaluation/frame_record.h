#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// What a run keeps of each frame: numbers only, no images and no map, so that hours fit in memory.
struct FrameRecord {
  std::int64_t index = 0;
  TrackingState state = TrackingState::kWaiting;
  std::string reason;
  bool repeated_image = false;
  bool ignored_image = false;  ///< late, broken or of another size: nothing was made of it
  ScaleSource scale_source = ScaleSource::kFree;
  double scale_sigma = 0.0, rescaled_by = 1.0;  ///< as in TrackedFrame
  std::string motion_source, motion_fault;
  StampedPose pose;    ///< a claim only when the state is kTracking
  double speed = 0.0;  ///< [m/s]
  Eigen::Matrix<double, 6, 6> pose_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double match_sigma_px = 0.0;  ///< as learnt so far; so are readout and lens
  double readout_s = 0.0;
  LensCorrection lens;
  double nis = 0.0;
  int nis_degrees = 0;
  double camera_bits = 0.0, state_bits_left = 0.0, camera_bits_per_ms = 0.0;  ///< TrackedFrame
  double tree_divergence_bits = 0.0;
  int map_features = 0, map_points = 0;  ///< all, and those converted from inverse depth
  int missed = 0, rejected = 0;
  int features_started = 0, features_retired = 0, features_converted = 0, features_failed = 0;
  int resets = 0, times_lost = 0, late_images = 0;
  int map = 0, jumps = 0;
  int submaps = 0, frozen_features = 0, trunk_features = 0;  ///< FrozenMap
  double lost_bits = 0.0;
  int submaps_frozen = 0, submaps_found = 0, loops = 0, map_epoch = 0;
  double quality = 1.0;
  double image_fixed = 0.0;  ///< share of the image
  std::string quality_reason;
  Accelerations accelerations;
  MatchStatistics matching;
  FrameTimings timings_ms;

  bool isTracked() const { return state == TrackingState::kTracking && !ignored_image; }
};

FrameRecord recordOf(const TrackedFrame& frame);

/// The records of a map whose lengths were multiplied by `factor`, known to a relative
/// `scale_sigma`: as if they always had been.
void rescaleRecords(double factor, double scale_sigma, int map, std::vector<FrameRecord>* records);

}  // namespace active_matching_slam
