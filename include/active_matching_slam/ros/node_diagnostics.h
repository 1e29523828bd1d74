#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// The node's health on /diagnostics, once a second of real time: 'images' (rate, latency, drops,
/// what is missing) and 'tracking' (state, scale, matches, filter). Safe from any thread.
class NodeDiagnostics {
 public:
  struct Images {
    std::uint64_t received = 0, dropped = 0;
    std::string silence;  ///< what is missing
    std::string topic;
  };

  explicit NodeDiagnostics(const ros::NodeHandle& private_node);

  /// Begins to report. `images` is called at each report, from the thread that serves the node's
  /// callbacks.
  void start(std::function<Images()> images);
  /// No more reports; one in work is waited for.
  void stop() { timer_.stop(); }

  /// `latency_s`: from the image's stamp, by ROS time; `turnaround_s`: from its arrival to the last
  /// message published, by real time.
  void record(const TrackedFrame& frame, double latency_s, double turnaround_s);
  /// Of the topic of odometry or IMU: what is wrong with it, and whether it was used all the same.
  void recordMotion(const std::string& topic, const std::string& fault, bool is_used);
  /// An image that could not be used, and why.
  void recordFault(const std::string& fault);

 private:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;
  void reportImages(Status& status);
  void reportTracking(Status& status);
  void forgetInterval();

  ros::NodeHandle node_;
  std::function<Images()> images_;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;

  std::mutex mutex_;  // guards what follows
  ros::WallTime interval_start_ = ros::WallTime::now();
  std::uint64_t received_before_ = 0, dropped_before_ = 0;
  int frames_ = 0;  ///< tracked in the interval
  double latency_sum_s_ = 0.0, turnaround_sum_s_ = 0.0, turnaround_max_s_ = 0.0;
  double nis_sum_ = 0.0;
  int nis_degrees_sum_ = 0;
  std::string fault_;
  TrackingState state_ = TrackingState::kWaiting;
  std::string reason_ = "no image yet";
  ScaleSource scale_source_ = ScaleSource::kFree;
  double scale_sigma_ = 0.0;
  std::string scale_fault_;
  std::string motion_topic_, motion_fault_;
  int motion_frames_ = 0, motion_used_ = 0;  ///< in the interval
  std::size_t features_ = 0;
  int candidates_ = 0, matched_ = 0, resets_ = 0, times_lost_ = 0;
  int map_ = 0;
  double quality_ = 1.0;
  double image_fixed_ = 0.0;  ///< share of the image
  std::string quality_reason_;
  std::string matcher_;
};

}  // namespace active_matching_slam
