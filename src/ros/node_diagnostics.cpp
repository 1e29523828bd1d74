#include "active_matching_slam/ros/node_diagnostics.h"

#include <algorithm>

namespace active_matching_slam {

using diagnostic_msgs::DiagnosticStatus;

NodeDiagnostics::NodeDiagnostics(const ros::NodeHandle& private_node)
    : node_(private_node), updater_(private_node, private_node, private_node.getNamespace()) {
  updater_.setHardwareID("none");
}

void NodeDiagnostics::start(std::function<Images()> images) {
  images_ = std::move(images);
  updater_.add("images", this, &NodeDiagnostics::reportImages);
  updater_.add("tracking", this, &NodeDiagnostics::reportTracking);
  // By real time: the updater's own period stops when simulated time jumps back.
  const boost::function<void(const ros::WallTimerEvent&)> report =
      [this](const ros::WallTimerEvent&) {
        updater_.force_update();
        forgetInterval();
      };
  timer_ = node_.createWallTimer(ros::WallDuration(1.0), report);
}

void NodeDiagnostics::record(const TrackedFrame& frame, double latency_s, double turnaround_s) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++frames_;
  latency_sum_s_ += latency_s;
  turnaround_sum_s_ += turnaround_s;
  turnaround_max_s_ = std::max(turnaround_max_s_, turnaround_s);
  nis_sum_ += frame.nis;
  nis_degrees_sum_ += frame.nis_degrees;
  fault_.clear();
  state_ = frame.state;
  reason_ = frame.reason;
  scale_source_ = frame.scale_source;
  scale_sigma_ = frame.scale_sigma;
  scale_fault_ = frame.scale_fault;
  features_ = frame.features.size();
  candidates_ = frame.matching.statistics.candidates;
  matched_ = frame.matching.statistics.matched;
  matcher_ = frame.matching.statistics.matcher;
  resets_ = frame.resets;
  times_lost_ = frame.times_lost;
  map_ = frame.map;
  quality_ = frame.quality;
  image_fixed_ = frame.image_fixed;
  quality_reason_ = frame.quality_reason;
}

void NodeDiagnostics::recordFault(const std::string& fault) {
  const std::lock_guard<std::mutex> lock(mutex_);
  fault_ = fault;
}

void NodeDiagnostics::recordMotion(const std::string& topic, const std::string& fault,
                                   bool is_used) {
  const std::lock_guard<std::mutex> lock(mutex_);
  motion_topic_ = topic;
  motion_fault_ = fault;
  ++motion_frames_;
  if (is_used) ++motion_used_;
}

void NodeDiagnostics::reportImages(Status& status) {
  const Images images = images_();
  const std::lock_guard<std::mutex> lock(mutex_);
  const double interval_s = std::max(0.1, (ros::WallTime::now() - interval_start_).toSec());
  const std::uint64_t dropped = images.dropped - dropped_before_;
  if (!images.silence.empty())
    status.summary(DiagnosticStatus::ERROR, images.silence);
  else if (!fault_.empty())
    status.summary(DiagnosticStatus::ERROR, fault_);
  else if (dropped > static_cast<std::uint64_t>(frames_))
    status.summary(DiagnosticStatus::WARN, "more images dropped than tracked");
  else
    status.summary(DiagnosticStatus::OK, "arriving");
  const int n = std::max(1, frames_);
  status.add("topic", images.topic);
  status.addf("received [Hz]", "%.1f", (images.received - received_before_) / interval_s);
  status.addf("tracked [Hz]", "%.1f", frames_ / interval_s);
  status.add("dropped", images.dropped);
  status.addf("latency from stamp, mean [ms]", "%.1f", 1e3 * latency_sum_s_ / n);
  status.addf("time in this node, mean [ms]", "%.1f", 1e3 * turnaround_sum_s_ / n);
  status.addf("time in this node, most [ms]", "%.1f", 1e3 * turnaround_max_s_);
  received_before_ = images.received;
  dropped_before_ = images.dropped;
}

void NodeDiagnostics::reportTracking(Status& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const double nis_ratio = nis_degrees_sum_ > 0 ? nis_sum_ / nis_degrees_sum_ : 0.0;
  const std::string because = reason_.empty() ? "" : ": " + reason_;
  switch (state_) {
    case TrackingState::kLost:
      status.summary(DiagnosticStatus::ERROR, "lost" + because);
      break;
    case TrackingState::kTracking:
      if (!quality_reason_.empty())
        status.summary(DiagnosticStatus::WARN,
                       "tracking, but not to be trusted: " + quality_reason_);
      else if (!motion_fault_.empty())
        status.summary(DiagnosticStatus::WARN, motion_fault_);
      else if (!scale_fault_.empty())
        status.summary(DiagnosticStatus::WARN, scale_fault_);
      else if (nis_ratio > 3.0)
        status.summary(DiagnosticStatus::WARN, "tracking, but matches disagree with the filter");
      else
        status.summary(DiagnosticStatus::OK, "tracking" + because);
      break;
    default:
      status.summary(DiagnosticStatus::WARN, trackingStateName(state_) + because);
  }
  status.add("state", trackingStateName(state_));
  status.add("scale", scaleSourceName(scale_source_));
  status.addf("scale known to [%]", "%.2f", 100.0 * scale_sigma_);
  status.add("motion from", motion_topic_.empty() ? "images alone" : motion_topic_);
  if (!motion_topic_.empty())
    status.addf("of images whose motion it told [%]", "%.0f",
                100.0 * motion_used_ / std::max(1, motion_frames_));
  status.add("matcher", matcher_);
  status.add("features", features_);
  status.add("candidates", candidates_);
  status.add("matched", matched_);
  status.addf("NIS by its degrees of freedom (1 when consistent)", "%.2f", nis_ratio);
  status.add("resets", resets_);
  status.add("times lost", times_lost_);
  status.add("map", map_);
  status.addf("quality, 0 to 1", "%.2f", quality_);
  status.addf("fixed to the image, and no scene [%]", "%.1f", 100.0 * image_fixed_);
}

void NodeDiagnostics::forgetInterval() {
  const std::lock_guard<std::mutex> lock(mutex_);
  interval_start_ = ros::WallTime::now();
  frames_ = motion_frames_ = motion_used_ = 0;
  latency_sum_s_ = turnaround_sum_s_ = turnaround_max_s_ = nis_sum_ = 0.0;
  nis_degrees_sum_ = 0;
}

}  // namespace active_matching_slam
