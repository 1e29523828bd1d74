#include "active_matching_slam/ros/frame_conversions.h"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/information/submap_color.h"
#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {
namespace {

ams_msgs::Feature toFeatureMsg(const TrackedFeature& feature, double information_bits, int submap) {
  ams_msgs::Feature message;
  message.id = feature.id;
  message.kind = feature.kind == FeatureKind::kPoint ? ams_msgs::Feature::POINT
                                                     : ams_msgs::Feature::INVERSE_DEPTH;
  message.status = static_cast<std::uint8_t>(feature.status);
  message.known = feature.known;
  message.position = toPointMsg(feature.position_world);
  fillRowMajor(feature.covariance_world, &message.position_covariance);
  if (feature.kind == FeatureKind::kInverseDepth) {
    message.anchor = toPointMsg(feature.anchor_world);
    message.bearing = toVectorMsg(feature.bearing_world);
    message.inverse_depth = finiteOrZero(feature.inverse_depth);
    message.sigma_inverse_depth = finiteOrZero(feature.sigma_inverse_depth);
  }
  if (feature.status != FeatureStatus::kNotVisible) {
    fillRowMajor(feature.predicted_px, &message.predicted_px);
    fillRowMajor(feature.innovation_covariance_px2, &message.innovation_covariance);
    message.information_bits = finiteOrZero(information_bits);
    message.camera_bits = finiteOrZero(feature.camera_bits);
    message.state_bits = finiteOrZero(feature.state_bits);
  }
  if (feature.status == FeatureStatus::kMatched || feature.status == FeatureStatus::kRejected) {
    fillRowMajor(feature.matched_px, &message.matched_px);
    message.score = static_cast<float>(finiteOrZero(feature.score));
  }
  message.true_positive_rate = feature.rates.true_positive;
  message.false_positive_rate = feature.rates.false_positive;
  message.gate_sigma_px = finiteOrZero(feature.gate_sigma_px);
  message.attempts = feature.attempts;
  message.successes = feature.successes;
  message.submap = submap;
  return message;
}

double largestSigma(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

}  // namespace

ams_msgs::TrackingState toTrackingStateMsg(const TrackedFrame& frame,
                                           const std_msgs::Header& header) {
  ams_msgs::TrackingState message;
  message.header = header;
  message.state = static_cast<std::uint8_t>(frame.state);
  message.state_name = trackingStateName(frame.state);
  message.reason = frame.reason;
  message.scale_source = static_cast<std::uint8_t>(frame.scale_source);
  message.scale_source_name = scaleSourceName(frame.scale_source);
  message.scale_sigma = static_cast<float>(finiteOrZero(frame.scale_sigma));
  message.scale_fault = frame.scale_fault;
  message.motion_source = frame.motion_source;
  message.motion_fault = frame.motion_fault;
  message.resets = frame.resets;
  message.times_lost = frame.times_lost;
  message.map = frame.map;
  message.map_epoch = frame.map_epoch;
  const Eigen::Quaterniond turn(frame.map_jump.linear());
  message.map_jump.translation.x = frame.map_jump.translation().x();
  message.map_jump.translation.y = frame.map_jump.translation().y();
  message.map_jump.translation.z = frame.map_jump.translation().z();
  message.map_jump.rotation.x = turn.x();
  message.map_jump.rotation.y = turn.y();
  message.map_jump.rotation.z = turn.z();
  message.map_jump.rotation.w = turn.w();
  message.jumps = frame.jumps;
  message.quality = static_cast<float>(finiteOrZero(frame.quality));
  message.quality_reason = frame.quality_reason;
  return message;
}

ams_msgs::FeatureArray toFeatureArrayMsg(const TrackedFrame& frame, int submap_level,
                                         const std_msgs::Header& header) {
  ams_msgs::FeatureArray message;
  message.header = header;
  const std::vector<int> submaps = submapsAtLevel(frame, submap_level);
  const auto bits_of = predictedInformationBits(frame);
  message.features.reserve(frame.features.size());
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (!isShowable(frame.features[i])) continue;
    const auto bits = bits_of.find(frame.features[i].id);
    message.features.push_back(
        toFeatureMsg(frame.features[i], bits == bits_of.end() ? 0.0 : bits->second, submaps[i]));
  }
  return message;
}

ams_msgs::MatchingStatistics toStatisticsMsg(const TrackedFrame& frame,
                                             std::uint64_t dropped_images,
                                             const std_msgs::Header& header) {
  const MatchStatistics& matching = frame.matching.statistics;
  ams_msgs::MatchingStatistics message;
  message.header = header;
  message.frame = frame.index;
  message.state = static_cast<std::uint8_t>(frame.state);
  message.scale_source = static_cast<std::uint8_t>(frame.scale_source);
  message.matcher = matching.matcher;
  message.candidates = matching.candidates;
  message.matched = matching.matched;
  message.searches = matching.searches;
  message.pixels_searched = matching.pixels_searched;
  message.pixels_full_gates = matching.pixels_full_gates;
  message.matches_met = matching.matches_met;
  message.max_gaussians = matching.max_gaussians;
  message.accepted_weight = finiteOrZero(matching.accepted_weight);
  message.ambiguous = matching.ambiguous;
  message.cut_short = matching.cut_short;
  message.information_bits_start = finiteOrZero(matching.information_bits_start);
  message.information_bits_left = finiteOrZero(matching.information_bits_end);
  message.camera_bits = finiteOrZero(frame.camera_bits);
  message.state_bits_left = finiteOrZero(frame.state_bits_left);
  message.camera_bits_per_ms = finiteOrZero(cameraBitsPerMillisecond(frame));
  message.tree_divergence_bits = finiteOrZero(treeDivergenceBits(frame));
  message.nis = finiteOrZero(frame.nis);
  message.nis_degrees = frame.nis_degrees;
  message.quality = finiteOrZero(frame.quality);
  message.image_fixed = frame.image_fixed;
  message.acceleration_mps2 = frame.accelerations.linear_mps2;
  message.angular_acceleration_rps2 = frame.accelerations.angular_rps2;
  message.match_sigma_px = frame.match_sigma_px;
  message.readout_s = frame.camera.readout_s;
  message.lens_focal = frame.camera.lens.focal;
  message.lens_radial = frame.camera.lens.radial;
  message.lens_centre_x = frame.camera.lens.centre.x();
  message.lens_centre_y = frame.camera.lens.centre.y();
  message.features = static_cast<std::uint32_t>(frame.features.size());
  message.features_started = frame.features_started;
  message.features_converted = frame.features_converted;
  message.features_retired = frame.features_retired;
  message.retired_total = frame.retired_total;
  if (frame.frozen) {
    message.submaps = frame.frozen->submaps;
    message.frozen_features = static_cast<std::uint32_t>(frame.frozen->features.size());
    message.trunk_features = frame.frozen->trunk_features;
    message.submap_lost_bits = finiteOrZero(frame.frozen->lost_bits);
    message.submaps_found = frame.frozen->found;
  }
  message.loops = frame.loops;
  message.dropped_images = dropped_images;
  message.repeated_image = frame.repeated_image;
  message.predict_ms = frame.timings_ms.predict;
  message.measure_ms = frame.timings_ms.measure;
  message.match_ms = frame.timings_ms.match;
  message.match_information_ms = matching.information_ms;
  message.match_correlation_ms = matching.correlation_ms;
  message.match_mixture_ms = matching.mixture_ms;
  message.match_tree_ms = matching.tree_ms;
  message.update_ms = frame.timings_ms.update;
  message.map_ms = frame.timings_ms.map;
  message.structure_ms = frame.timings_ms.structure;
  message.total_ms = frame.timings_ms.total;
  return message;
}

ams_msgs::MatchHypotheses toHypothesesMsg(const TrackedFrame& frame,
                                          const std_msgs::Header& header) {
  ams_msgs::MatchHypotheses message;
  message.header = header;
  message.matcher = frame.matching.statistics.matcher;
  for (const MatchHypothesis& hypothesis : frame.matching.hypotheses) {
    ams_msgs::MatchHypothesis& out = message.hypotheses.emplace_back();
    out.probability = finiteOrZero(hypothesis.probability);
    out.gaussian = hypothesis.gaussian;
    out.parent = hypothesis.parent;
    // By the prior: a feature that was retired after the matching is no longer in `features`.
    const std::size_t count = std::min(
        {hypothesis.match_of_feature.size(), frame.prior.ids.size(), frame.matches.size()});
    for (std::size_t i = 0; i < count; ++i) {
      const int match = hypothesis.match_of_feature[i];
      if (match < 0 || match >= static_cast<int>(frame.matches[i].size())) continue;
      out.feature_ids.push_back(frame.prior.ids[i]);
      out.u.push_back(static_cast<float>(frame.matches[i][match].pixel.x()));
      out.v.push_back(static_cast<float>(frame.matches[i][match].pixel.y()));
    }
  }
  return message;
}

ams_msgs::MutualInformationGraph toGraphMsg(const TrackedFrame& frame,
                                            const std_msgs::Header& header) {
  ams_msgs::MutualInformationGraph message;
  message.header = header;
  if (!frame.graph) return message;
  message.ids = frame.graph->ids;
  message.links.reserve(frame.graph->links.size());
  for (const InformationLink& link : frame.graph->links) {
    ams_msgs::InformationLink& out = message.links.emplace_back();
    out.first = link.first;
    out.second = link.second;
    out.information_bits = finiteOrZero(link.information_bits);
    out.frames = link.frames;
    out.in_tree = link.in_tree;
  }
  return message;
}

ams_msgs::SubmapHierarchy toSubmapsMsg(const TrackedFrame& frame, const std_msgs::Header& header) {
  ams_msgs::SubmapHierarchy message;
  message.header = header;
  if (frame.frozen) {
    for (const FrozenSubmap& leaf : frame.frozen->leaves) {
      message.laid_aside.push_back(leaf.id);
      message.laid_aside_features.push_back(static_cast<std::uint32_t>(leaf.features));
      message.laid_aside_separators.push_back(static_cast<std::uint32_t>(leaf.separators));
      message.laid_aside_lost_bits.push_back(finiteOrZero(leaf.lost_bits));
    }
  }
  if (!frame.submaps) return message;
  message.ids = frame.submaps->ids;
  const auto fill = [](const SubmapLevel& level, ams_msgs::SubmapLevel* out) {
    out->submap_of_feature.assign(level.submap_of_feature.begin(), level.submap_of_feature.end());
    out->submaps = level.submaps;
    out->preserved_chow_liu = finiteOrZero(level.preserved_chow_liu);
    out->preserved_naive = finiteOrZero(level.preserved_naive);
  };
  for (const SubmapLevel& level : frame.submaps->levels)
    fill(level, &message.levels.emplace_back());
  fill(frame.submaps->requested, &message.requested);
  return message;
}

sensor_msgs::PointCloud2 toPointCloudMsg(const TrackedFrame& frame, int submap_level,
                                         const std_msgs::Header& header) {
  using sensor_msgs::PointField;
  std::vector<std::size_t> shown;
  for (std::size_t i = 0; i < frame.features.size(); ++i)
    if (isShowable(frame.features[i])) shown.push_back(i);

  sensor_msgs::PointCloud2 cloud;
  cloud.header = header;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  modifier.setPointCloud2Fields(7, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1,
                                PointField::FLOAT32, "sigma", 1, PointField::FLOAT32, "id", 1,
                                PointField::INT32, "submap", 1, PointField::INT32, "rgb", 1,
                                PointField::FLOAT32);
  modifier.resize(shown.size());
  cloud.is_dense = true;
  if (shown.empty()) return cloud;  // iterators would look at the first of no bytes
  sensor_msgs::PointCloud2Iterator<float> xyz(cloud, "x"), sigma(cloud, "sigma");
  sensor_msgs::PointCloud2Iterator<std::int32_t> id(cloud, "id"), submap(cloud, "submap");
  sensor_msgs::PointCloud2Iterator<std::uint8_t> bgr(cloud, "rgb");
  const std::vector<int> submaps = submapsAtLevel(frame, submap_level);
  for (std::size_t i : shown) {
    const TrackedFeature& feature = frame.features[i];
    for (int axis = 0; axis < 3; ++axis)
      xyz[axis] = static_cast<float>(feature.position_world[axis]);
    *sigma = static_cast<float>(largestSigma(feature.covariance_world));
    *id = static_cast<std::int32_t>(feature.id);
    *submap = submaps[i];
    const std_msgs::ColorRGBA color = submapColor(submaps[i]);
    bgr[0] = static_cast<std::uint8_t>(255 * color.b);
    bgr[1] = static_cast<std::uint8_t>(255 * color.g);
    bgr[2] = static_cast<std::uint8_t>(255 * color.r);
    ++xyz, ++sigma, ++id, ++submap, ++bgr;
  }
  return cloud;
}

bool isShowable(const TrackedFeature& feature, double limit_m) {
  return feature.position_world.allFinite() && feature.covariance_world.allFinite() &&
         feature.position_world.cwiseAbs().maxCoeff() < limit_m;
}

std_msgs::ColorRGBA submapColor(int submap) {
  const Eigen::Vector3f rgb = submapRgb(submap);
  std_msgs::ColorRGBA color;
  color.r = rgb[0];
  color.g = rgb[1];
  color.b = rgb[2];
  color.a = 1.0f;
  return color;
}

}  // namespace active_matching_slam
