#pragma once

#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>

#include <string>

#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "camera_bag_writer.h"

namespace active_matching_slam {

/// What a node called `tracker` would have published, as far as rviz shows it: to be played, or
/// compared with other systems. Throws rosbag::BagException when the file cannot be written.
class TrackedBagWriter {
 public:
  explicit TrackedBagWriter(const std::string& path) : bag_(path, rosbag::bagmode::Write) {}

  void add(const TrackedFrame& frame) {
    std_msgs::Header header;
    header.stamp.fromSec(frame.stamp_s);
    const ros::Time time = CameraBagWriter::recordTime(header.stamp);
    header.frame_id = kCamera;
    bag_.write("/tracker/state", time, toTrackingStateMsg(frame, header));
    bag_.write("/tracker/statistics", time, toStatisticsMsg(frame, 0, header));
    header.frame_id = kWorld;
    bag_.write("/tracker/map", time, toPointCloudMsg(frame, 0, header));
    if (frame.state != TrackingState::kTracking || frame.image.empty()) return;
    const RigidBodyState camera =
        rigidBodyState(frame.camera, frame.camera_covariance, Eigen::Isometry3d::Identity());
    bag_.write("/tracker/pose", time, toPoseWithCovarianceMsg(camera, header));
    bag_.write("/tracker/odometry", time, toOdometryMsg(camera, header, kCamera));
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(toTransformMsg(camera.T_world_body, header.stamp, kWorld, kCamera));
    bag_.write("/tf", time, tf);
  }

 private:
  static constexpr const char* kWorld = "world";
  static constexpr const char* kCamera = "camera";
  rosbag::Bag bag_;
};

}  // namespace active_matching_slam
