#include "active_matching_slam/tracker/tracked_frame.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Null when it has left the map by now.
TrackedFeature* findFeature(FeatureId id, TrackedFrame* frame) {
  const auto it =
      std::lower_bound(frame->features.begin(), frame->features.end(), id,
                       [](const TrackedFeature& f, FeatureId wanted) { return f.id < wanted; });
  return it != frame->features.end() && it->id == id ? &*it : nullptr;
}

}  // namespace

std::string trackingStateName(TrackingState state) {
  switch (state) {
    case TrackingState::kWaiting:
      return "waiting";
    case TrackingState::kInitialising:
      return "initialising";
    case TrackingState::kTracking:
      return "tracking";
    case TrackingState::kLost:
      return "lost";
  }
  return "";
}

std::string scaleSourceName(ScaleSource source) {
  switch (source) {
    case ScaleSource::kFree:
      return "free";
    case ScaleSource::kKnownTarget:
      return "known_target";
    case ScaleSource::kKnownPoints:
      return "known_points";
    case ScaleSource::kService:
      return "service";
    case ScaleSource::kOdometry:
      return "odometry";
    case ScaleSource::kTag:
      return "tag";
    case ScaleSource::kChessboard:
      return "chessboard";
    case ScaleSource::kCameraHeight:
      return "camera_height";
  }
  return "";
}

std::string featureStatusName(FeatureStatus status) {
  switch (status) {
    case FeatureStatus::kNotVisible:
      return "not_visible";
    case FeatureStatus::kNotSearched:
      return "not_searched";
    case FeatureStatus::kMissed:
      return "missed";
    case FeatureStatus::kRejected:
      return "rejected";
    case FeatureStatus::kMatched:
      return "matched";
  }
  return "";
}

std::unordered_map<FeatureId, double> predictedInformationBits(const TrackedFrame& frame) {
  std::unordered_map<FeatureId, double> bits_of;
  const Eigen::VectorXd bits = featureInformation(frame.prior.S).bits;
  for (int i = 0; i < frame.prior.size(); ++i) bits_of[frame.prior.ids[i]] = bits[i];
  return bits_of;
}

std::string imageFixedMessage(double share) {
  if (!(share > 0.0)) return "";
  std::ostringstream message;
  message << std::setprecision(2) << 100.0 * share
          << " % of the image is fixed to it and no part of the scene (burnt-in text, dirt, the "
             "robot itself): it is left out";
  return message.str();
}

double treeDivergenceBits(const TrackedFrame& frame) {
  if (frame.matching.tree_edges.empty()) return 0.0;
  std::vector<WeightedEdge> edges;
  for (const auto& [first, second] : frame.matching.tree_edges)
    edges.push_back({first, second, pairInformationBits(frame.prior.S, first, second)});
  return treeDivergenceBits(frame.prior.S, treeOf(frame.prior.S, std::move(edges))).value_or(0.0);
}

double cameraBitsPerMillisecond(const TrackedFrame& frame) {
  const FrameTimings& spent = frame.timings_ms;
  const double ms = spent.measure + spent.match + spent.update;
  return ms > 0.0 ? frame.camera_bits / ms : 0.0;
}

/// The state of the tracker, of which every frame gives an account.
void Tracker::Implementation::describeState(TrackedFrame* frame) const {
  frame->scale_source = scale_source_;
  frame->scale_fault = scale_fault_;
  if ((options_.motion.hasOdometry() && scale_source_ != ScaleSource::kFree) ||
      scale_source_ == ScaleSource::kCameraHeight)
    frame->scale_sigma = filter_.scaleSigma();
  if (motion_) frame->motion_source = options_.motion.motion_prior;
  frame->motion_fault = motion_fault_;
  frame->camera = filter_.camera();
  frame->camera_covariance = filter_.cameraCovariance();
  frame->retired_total = map_.retiredTotal();
  frame->resets = resets_;
  frame->times_lost = times_lost_;
  frame->map = map_number_;
  frame->jumps = jumps_;
  frame->loops = loops_;
  frame->map_epoch = map_epoch_;
  if (submaps_.isEnabled()) frame->frozen = submaps_.describe(filter_);
  frame->quality = quality_.quality();
  frame->quality_reason = quality_.cause();
  frame->accelerations = motion_noise_.expected();
  frame->late_images = late_images_;
  frame->image_fixed = image_fixed_.share();
  if (frame->image_fixed > 0.0) {
    cv::bitwise_not(image_fixed_.fixed(), frame->mask);
    if (!mask_.isWhole()) cv::bitwise_and(frame->mask, mask_.used(), frame->mask);
  }
  for (const MapFeature& feature : map_.features()) {
    const FeatureState& state = *filter_.find(feature.id);
    TrackedFeature out;
    out.id = feature.id;
    out.kind = state.kind;
    out.position_world = state.position();
    out.covariance_world = filter_.positionCovariance(state);
    out.anchor_world = state.anchor_world;
    out.bearing_world = state.bearing_world;
    out.inverse_depth = state.inverse_depth;
    if (state.kind == FeatureKind::kInverseDepth)
      out.sigma_inverse_depth = filter_.sigmaInverseDepth(state);
    out.known = feature.known;
    out.rates = feature.rates.rates({options_.matching.default_rates});
    out.gate_sigma_px = noise_.gateSigma_px(feature);
    out.attempts = feature.attempts;
    out.successes = feature.successes;
    out.template_image = feature.patch.image;
    out.predicted_px.setZero();
    out.innovation_covariance_px2.setZero();
    out.matched_px.setZero();
    frame->features.push_back(out);
  }
}

/// What was predicted, searched and matched. After describeState().
void Tracker::Implementation::describeMatches(FrameState current, TrackedFrame* frame) {
  frame->matching = std::move(current.matching);
  frame->state_bits_left = current.bits_left;
  for (std::size_t i = 0; i < current.visible.size(); ++i) {
    TrackedFeature* feature = findFeature(current.visible[i].id, frame);
    if (!feature) continue;
    feature->camera_bits = current.visible_bits[i];
    feature->state_bits = current.visible_state_bits[i];
  }
  if (current.prior.size() == 0) return;
  frame->prior = std::move(current.prior);
  frame->templates = std::move(current.templates);
  for (int i = 0; i < frame->prior.size(); ++i) frame->matches.push_back(current.search.matches(i));
  std::size_t next = 0;
  for (int i = 0; i < frame->prior.size(); ++i) {
    const bool used = next < current.inliers.size() && current.inliers[next] == i;
    const Eigen::Vector2d pixel =
        used ? current.measurements[next++].pixel : Eigen::Vector2d::Zero();
    TrackedFeature* it = findFeature(frame->prior.ids[i], frame);
    if (!it) continue;
    it->predicted_px = frame->prior.mean(i);
    it->innovation_covariance_px2 = frame->prior.covariance(i);
    const auto& matches = frame->matches[i];
    if (used) {
      it->status = FeatureStatus::kMatched;
      it->matched_px = pixel;
      it->score = matches[frame->matching.match_of_feature[i]].score;
    } else if (!matches.empty()) {
      const auto best = std::max_element(
          matches.begin(), matches.end(),
          [](const SearchMatch& a, const SearchMatch& b) { return a.score < b.score; });
      it->status = FeatureStatus::kRejected;
      it->matched_px = best->pixel;
      it->score = best->score;
    } else {
      const bool is_missed =
          current.search.searchedPixels(i).size() > 0 && !current.search.isPartlyMasked(i);
      it->status = is_missed ? FeatureStatus::kMissed : FeatureStatus::kNotSearched;
    }
  }
}

}  // namespace active_matching_slam
