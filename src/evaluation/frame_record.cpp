#include "active_matching_slam/evaluation/frame_record.h"

namespace active_matching_slam {

FrameRecord recordOf(const TrackedFrame& frame) {
  FrameRecord record;
  record.index = frame.index;
  record.state = frame.state;
  record.reason = frame.reason;
  record.repeated_image = frame.repeated_image;
  record.ignored_image = frame.image.empty();
  record.scale_source = frame.scale_source;
  record.scale_sigma = frame.scale_sigma;
  record.rescaled_by = frame.rescaled_by;
  record.motion_source = frame.motion_source;
  record.motion_fault = frame.motion_fault;
  record.pose = {frame.stamp_s, frame.camera.poseWorldCamera()};
  record.speed = frame.camera.velocity_world.norm();
  record.pose_covariance = frame.camera_covariance.topLeftCorner<6, 6>();
  record.match_sigma_px = frame.match_sigma_px;
  record.readout_s = frame.camera.readout_s;
  record.lens = frame.camera.lens;
  record.nis = frame.nis;
  record.nis_degrees = frame.nis_degrees;
  record.camera_bits = frame.camera_bits;
  record.state_bits_left = frame.state_bits_left;
  record.camera_bits_per_ms = cameraBitsPerMillisecond(frame);
  record.tree_divergence_bits = treeDivergenceBits(frame);
  record.map_features = static_cast<int>(frame.features.size());
  for (const TrackedFeature& feature : frame.features) {
    if (feature.kind == FeatureKind::kPoint) ++record.map_points;
    if (feature.status == FeatureStatus::kMissed) ++record.missed;
    if (feature.status == FeatureStatus::kRejected) ++record.rejected;
  }
  record.features_started = frame.features_started;
  record.features_retired = frame.features_retired;
  record.features_converted = frame.features_converted;
  record.features_failed = frame.features_failed;
  record.resets = frame.resets;
  record.times_lost = frame.times_lost;
  record.map = frame.map;
  record.jumps = frame.jumps;
  if (frame.frozen) {
    record.submaps = frame.frozen->submaps;
    record.frozen_features = static_cast<int>(frame.frozen->features.size());
    record.trunk_features = frame.frozen->trunk_features;
    record.lost_bits = frame.frozen->lost_bits;
    record.submaps_frozen = frame.frozen->frozen;
    record.submaps_found = frame.frozen->found;
  }
  record.loops = frame.loops;
  record.map_epoch = frame.map_epoch;
  record.quality = frame.quality;
  record.image_fixed = frame.image_fixed;
  record.quality_reason = frame.quality_reason;
  record.accelerations = frame.accelerations;
  record.late_images = frame.late_images;
  record.matching = frame.matching.statistics;
  record.timings_ms = frame.timings_ms;
  return record;
}

void rescaleRecords(double factor, double scale_sigma, int map, std::vector<FrameRecord>* records) {
  for (FrameRecord& record : *records) {
    if (record.map != map) continue;
    const Eigen::Vector3d position = record.pose.T_world_camera.translation() *= factor;
    record.speed *= factor;
    record.pose_covariance.topRows<3>() *= factor;
    record.pose_covariance.leftCols<3>() *= factor;
    record.pose_covariance.topLeftCorner<3, 3>() +=
        scale_sigma * scale_sigma * position * position.transpose();
  }
}

}  // namespace active_matching_slam
