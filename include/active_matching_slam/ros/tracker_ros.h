#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <memory>
#include <string>
#include <vector>

#include "active_matching_slam/ros/camera_subscription.h"
#include "active_matching_slam/ros/data_directory.h"
#include "active_matching_slam/ros/frame_publisher.h"
#include "active_matching_slam/ros/frame_worker.h"
#include "active_matching_slam/ros/masked_images.h"
#include "active_matching_slam/ros/messages.h"
#include "active_matching_slam/ros/motion_subscription.h"
#include "active_matching_slam/ros/node_diagnostics.h"
#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/ros/pose_broadcaster.h"
#include "active_matching_slam/ros/reconfigure_server.h"
#include "active_matching_slam/ros/repeated_warning.h"
#include "active_matching_slam/ros/tracking_session.h"
#include "active_matching_slam/ros/trajectory_log.h"

namespace active_matching_slam {

/// All settings of a node, as read from its private namespace.
struct NodeSettings {
  TrackerOptions tracker;
  NodeOptions node;
};
/// Throws std::invalid_argument or std::runtime_error naming the parameter (or file) at fault.
NodeSettings readNodeSettings(const ros::NodeHandle& private_node);

/// The tracker as a member of a ROS graph: what node and nodelet share.
///
/// Subscribes to `image` (image_transport) and the camera_info beside it, `initialpose` and ~mask,
/// and, as motion_prior says, to `odometry` or `imu`; publishes what FramePublisher,
/// PoseBroadcaster, NodeDiagnostics and ReconfigureServer say; serves ~reset, ~save_map, ~load_map,
/// ~save_trajectory, ~set_scale, ~set_matcher. Parameters: option_field.h and node_options.h.
///
/// Callbacks must come one at a time; tracking runs in a thread of its own, on the newest image.
class TrackerRos {
 public:
  /// Throws as readNodeSettings() does.
  explicit TrackerRos(const ros::NodeHandle& private_node);
  ~TrackerRos();

 private:
  // In the worker's thread.
  void process(const CameraImage& image) noexcept;
  void track(const CameraImage& image);
  void publish(const TrackedFrame& frame, const CameraImage& image);
  void noticeChanges(const TrackedFrame& frame, const ros::Time& stamp);
  std::string noticeMotion(const TrackedFrame& frame);
  void noticeScale(const TrackedFrame& frame);
  void noticeImageFixed(const TrackedFrame& frame);
  void forgetPast(bool time_jumped);
  std::string cameraFrame(const std_msgs::Header& header) const;

  // In the thread that serves callbacks.
  void advertiseServices();
  void subscribeBeside();
  void onInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message);
  void setPose(const geometry_msgs::PoseWithCovarianceStamped& message);
  std::string applyChanges(const std::vector<ReconfigureServer::Change>& changes);
  /// Runs `task` in the worker; success and message are what the service answers.
  template <class Response>
  bool answer(Response& response, const std::function<void()>& task);
  bool onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&);
  bool onSaveMap(ams_msgs::SaveMap::Request&, ams_msgs::SaveMap::Response&);
  bool onLoadMap(ams_msgs::LoadMap::Request&, ams_msgs::LoadMap::Response&);
  bool onSaveTrajectory(ams_msgs::SaveTrajectory::Request&, ams_msgs::SaveTrajectory::Response&);
  bool onSetScale(ams_msgs::SetScale::Request&, ams_msgs::SetScale::Response&);
  bool onSetMatcher(ams_msgs::SetMatcher::Request&, ams_msgs::SetMatcher::Response&);

  ros::NodeHandle private_node_;
  NodeSettings settings_;  // the callbacks' copy
  DataDirectory data_directory_;
  NodeDiagnostics diagnostics_;

  // The worker's own.
  NodeOptions options_;
  TrackingSession session_;
  FramePublisher publisher_;
  PoseBroadcaster broadcaster_;
  TrajectoryLog trajectory_;
  TrackingState state_ = TrackingState::kWaiting;
  std::shared_ptr<const TrackedFrame> last_frame_;
  std::string camera_frame_ = "camera";  ///< of the last image
  int generation_ = 0, resets_ = 0;
  int map_ = 0;
  double last_stamp_s_ = 0.0;
  RepeatedWarning warning_, restart_warning_;
  std::string reset_cause_;  ///< asked for by a service: not worth a warning

  std::unique_ptr<FrameWorker<CameraImage>> worker_;
  std::unique_ptr<MaskedImages> masked_images_;
  std::unique_ptr<MotionSubscription> motion_;
  bool is_motion_told_ = true;  ///< nothing was said yet of its being missing
  OnceWarning motion_warning_, scale_warning_, image_fixed_warning_;
  std::unique_ptr<CameraSubscription> subscription_;
  ros::Subscriber mask_, initial_pose_;
  std::unique_ptr<ReconfigureServer> reconfigure_;
  std::vector<ros::ServiceServer> services_;
};

}  // namespace active_matching_slam
