#pragma once

#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "active_matching_slam/ros/repeated_warning.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// Sends the pose to /tf and knows the robot's own chain of frames.
///
/// tf_mode camera: world_frame -> camera (or -> base_frame, when given: a frame has one parent, and
/// the robot's description already holds the camera's). With map_frame, map_frame -> world_frame is
/// sent once: the first camera upright, z up.
/// tf_mode map_to_odom (REP 105): map_frame -> odom_frame, so that the chain map, odom, base,
/// camera ends where the tracker sees the camera. map_frame is laid on odom_frame at the first pose
/// after a (re)start, and map_frame -> world_frame is sent to say where the features are.
class PoseBroadcaster {
 public:
  explicit PoseBroadcaster(const NodeOptions& options);

  void setOptions(const NodeOptions& options) { options_ = options; }
  /// Forgets what was learnt of the past: after a reset of the tracker or a jump in time.
  void reset(bool time_jumped);

  /// T_camera_base at the image's time; identity without base_frame, empty when tf does not know it
  /// (logged, throttled).
  std::optional<Eigen::Isometry3d> cameraFromBase(const std::string& camera_frame,
                                                  const ros::Time& stamp);

  /// The camera in the world, of a pose in `frame_id`: in world_frame the camera's own, as ~pose
  /// is; in map_frame (z up) that of a body that looks along x, as rviz sends it; with base_frame
  /// that frame's, in either. Throws std::invalid_argument for other frames.
  UncertainPose cameraOf(const UncertainPose& given, const std::string& frame_id,
                         const std::string& camera_frame);

  /// Sends the transforms of a frame whose state is kTracking. `T_camera_base` as above.
  void send(const TrackedFrame& frame, const std::string& camera_frame, const ros::Time& stamp,
            const Eigen::Isometry3d& T_camera_base);

 private:
  std::optional<Eigen::Isometry3d> lookup(const std::string& target, const std::string& source,
                                          const ros::Time& stamp);
  void sendMapToOdom(const TrackedFrame& frame, const std::string& camera_frame,
                     const ros::Time& stamp);
  void onTransforms(const tf2_msgs::TFMessage& message);
  void sendStatic(const Eigen::Isometry3d& T_map_world, const ros::Time& stamp);

  NodeOptions options_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  tf2_ros::Buffer buffer_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;  ///< null when nothing is looked up
  std::optional<Eigen::Isometry3d> T_map_world_;
  RepeatedWarning warning_;
  ros::Subscriber transforms_, static_transforms_;  ///< of others
  std::mutex mutex_;                                ///< guards what follows
  std::string child_frame_;                         ///< to which transforms are sent
  RepeatedWarning parents_warning_;
};

}  // namespace active_matching_slam
