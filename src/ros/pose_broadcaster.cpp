#include "active_matching_slam/ros/pose_broadcaster.h"

#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {

PoseBroadcaster::PoseBroadcaster(const NodeOptions& options) : options_(options) {
  if (options_.tf_mode == "map_to_odom" || !options_.base_frame.empty())
    listener_ = std::make_unique<tf2_ros::TransformListener>(buffer_);
  if (options_.tf_mode == "camera" && !options_.map_frame.empty()) {
    Eigen::Isometry3d T_map_world = Eigen::Isometry3d::Identity();
    T_map_world.linear() = bodyFromOptical().toRotationMatrix();
    sendStatic(T_map_world, ros::Time());
  }
}

void PoseBroadcaster::reset(bool time_jumped) {
  if (options_.tf_mode == "map_to_odom") T_map_world_.reset();
  if (time_jumped && listener_) buffer_.clear();
}

std::optional<Eigen::Isometry3d> PoseBroadcaster::lookup(const std::string& target,
                                                         const std::string& source,
                                                         const ros::Time& stamp) {
  // The wait is of real time: one of simulated time would not end while that clock stands still.
  // There is none for frames that nothing connects.
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(options_.tf_timeout_s);
  for (;;) {
    try {
      return fromTransformMsg(buffer_.lookupTransform(target, source, stamp).transform);
    } catch (const tf2::TransformException& error) {
      if (ros::WallTime::now() >= deadline || !buffer_.canTransform(target, source, ros::Time(0))) {
        warning_.say(source + target,
                     "No transform from " + source + " to " + target + " on tf: " + error.what());
        return std::nullopt;
      }
    }
    ros::WallDuration(0.002).sleep();
  }
}

std::optional<Eigen::Isometry3d> PoseBroadcaster::cameraFromBase(const std::string& camera_frame,
                                                                 const ros::Time& stamp) {
  if (options_.base_frame.empty()) return Eigen::Isometry3d::Identity();
  return lookup(camera_frame, options_.base_frame, stamp);
}

void PoseBroadcaster::send(const TrackedFrame& frame, const std::string& camera_frame,
                           const ros::Time& stamp, const Eigen::Isometry3d& T_camera_base) {
  if (options_.tf_mode == "map_to_odom") {
    sendMapToOdom(frame, camera_frame, stamp);
  } else if (options_.tf_mode == "camera") {
    const std::string& child = options_.base_frame.empty() ? camera_frame : options_.base_frame;
    broadcaster_.sendTransform(toTransformMsg(frame.camera.poseWorldCamera() * T_camera_base, stamp,
                                              options_.world_frame, child));
  }
}

void PoseBroadcaster::sendMapToOdom(const TrackedFrame& frame, const std::string& camera_frame,
                                    const ros::Time& stamp) {
  const auto T_odom_camera = lookup(options_.odom_frame, camera_frame, stamp);
  if (!T_odom_camera) return;
  const Eigen::Isometry3d T_world_camera = frame.camera.poseWorldCamera();
  if (!T_map_world_) {
    if (frame.scale_source == ScaleSource::kFree)
      ROS_WARN(
          "tf_mode is map_to_odom, but the scale of the map is free: map -> odom will be wrong "
          "until "
          "~set_scale or a known target fixes it");
    sendStatic(*T_odom_camera * T_world_camera.inverse(), stamp);
  }
  const Eigen::Isometry3d T_map_odom = *T_map_world_ * T_world_camera * T_odom_camera->inverse();
  broadcaster_.sendTransform(toTransformMsg(T_map_odom,
                                            stamp + ros::Duration(options_.transform_tolerance_s),
                                            options_.map_frame, options_.odom_frame));
}

void PoseBroadcaster::sendStatic(const Eigen::Isometry3d& T_map_world, const ros::Time& stamp) {
  T_map_world_ = T_map_world;
  static_broadcaster_.sendTransform(
      toTransformMsg(T_map_world, stamp, options_.map_frame, options_.world_frame));
}

}  // namespace active_matching_slam
