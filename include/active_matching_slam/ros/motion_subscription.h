#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <condition_variable>
#include <memory>
#include <deque>
#include <mutex>
#include <string>

#include "active_matching_slam/tracker/motion_history.h"

namespace active_matching_slam {

/// Listens to `odometry` or `imu`, beside the node, as motion_prior says, and to tf for where the
/// camera is on the robot, which must be fixed there: the first answer holds. Messages are received
/// in the thread of the callbacks and wait there; collect() takes them into the history in the
/// thread that tracks.
class MotionSubscription {
 public:
  MotionSubscription(const ros::NodeHandle& private_node, const MotionOptions& options);
  ~MotionSubscription();
  MotionSubscription(const MotionSubscription&) = delete;
  MotionSubscription& operator=(const MotionSubscription&) = delete;

  bool isOn() const { return history_ != nullptr; }
  /// Null when motion_prior is none.
  std::shared_ptr<const MotionHistory> history() const { return history_; }
  const std::string& topic() const { return topic_; }
  void setOptions(const MotionOptions& options);

  /// Takes in all that has come, and waits for what is still missing up to the image's stamp: no
  /// longer than odometry_timeout_s of real time, and not at all where nothing comes.
  void collect(const ros::Time& stamp, const std::string& camera_frame);
  /// Whether anything came for the image in hand.
  bool hasCome() const { return has_come_; }
  /// What is wrong with what came, or with the frames; empty: nothing.
  const std::string& fault() const { return fault_; }

 private:
  void onOdometry(const nav_msgs::OdometryConstPtr& message);
  void onImu(const sensor_msgs::ImuConstPtr& message);
  void received();
  void takeIn();
  void findCamera(const std::string& camera_frame);

  MotionOptions options_;
  std::string topic_, fault_;
  bool has_come_ = false;
  std::shared_ptr<MotionHistory> history_;
  std::string base_frame_, camera_frame_;  ///< of the last message, and of the place that is known
  std::unique_ptr<tf2_ros::Buffer> buffer_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;

  std::mutex mutex_;
  std::condition_variable arrival_;
  std::deque<nav_msgs::OdometryConstPtr> odometry_;  ///< not taken in yet
  std::deque<sensor_msgs::ImuConstPtr> imu_;         ///< likewise
  ros::WallTime last_arrival_;
  ros::Subscriber subscriber_;  // last: ends before what its callbacks use
};

}  // namespace active_matching_slam
