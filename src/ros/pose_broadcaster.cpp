#include "active_matching_slam/ros/pose_broadcaster.h"

#include <stdexcept>

#include "active_matching_slam/ros/frame_name.h"
#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {

namespace {

/// As many as a busy /tf has in a second. Cost: memory for so many messages.
constexpr int kTransformQueueSize = 1000;

}  // namespace

PoseBroadcaster::PoseBroadcaster(const NodeOptions& options) : options_(options) {
  if (options_.tf_mode == "camera") {
    ros::NodeHandle node;
    transforms_ = node.subscribe("/tf", kTransformQueueSize, &PoseBroadcaster::onTransforms, this);
    static_transforms_ =
        node.subscribe("/tf_static", kTransformQueueSize, &PoseBroadcaster::onTransforms, this);
  }
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
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      child_frame_ = child;
    }
    broadcaster_.sendTransform(toTransformMsg(frame.camera.poseWorldCamera() * T_camera_base, stamp,
                                              options_.world_frame, child));
  }
}

/// A frame has one parent: says so when another node gives ours a second.
void PoseBroadcaster::onTransforms(const tf2_msgs::TFMessage& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const geometry_msgs::TransformStamped& transform : message.transforms) {
    const std::string parent = withoutLeadingSlash(transform.header.frame_id);
    if (child_frame_.empty() || withoutLeadingSlash(transform.child_frame_id) != child_frame_ ||
        parent == options_.world_frame)
      continue;
    parents_warning_.say("Frame '" + child_frame_ + "' has two parents on tf, '" +
                         options_.world_frame + "' by this node and '" + parent +
                         "' by another: set base_frame to a frame without a parent, tf_mode to "
                         "map_to_odom, or to none");
  }
}

UncertainPose PoseBroadcaster::cameraOf(const UncertainPose& given, const std::string& frame_id,
                                        const std::string& camera_frame) {
  const std::string frame = withoutLeadingSlash(frame_id);
  const bool in_map = frame == options_.map_frame && T_map_world_;
  if (frame != options_.world_frame && !in_map)
    throw std::invalid_argument("its frame_id is '" + frame_id + "', must be " +
                                options_.world_frame +
                                (T_map_world_ ? " or " + options_.map_frame : ""));
  const Eigen::Isometry3d T_world_frame =
      in_map ? T_map_world_->inverse() : Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_given_camera = Eigen::Isometry3d::Identity();
  if (!options_.base_frame.empty()) {
    const auto T_camera_base = cameraFromBase(camera_frame, ros::Time(0));
    if (!T_camera_base)
      throw std::invalid_argument("tf has no transform from " + options_.base_frame + " to " +
                                  camera_frame);
    T_given_camera = T_camera_base->inverse();
  } else if (in_map) {
    T_given_camera.linear() = bodyFromOptical().toRotationMatrix();
  }
  return transformed(given, T_world_frame, T_given_camera);
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
