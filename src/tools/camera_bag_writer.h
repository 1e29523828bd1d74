#pragma once

#include <cv_bridge/cv_bridge.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/image_encodings.h>
#include <std_msgs/String.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/ros/image_conversions.h"

namespace active_matching_slam {

/// Writes images of one camera, its camera_info and, where known, its true poses to a bag: the
/// topics that the tracker subscribes to by default. The file appears under its name when close()
/// is called; until then, and when an exception ends the writing, there is only a file with ".part"
/// appended, which the destructor removes. Throws rosbag::BagException when the file cannot be
/// written.
class CameraBagWriter {
 public:
  static constexpr const char* kImageTopic = "/camera/image_raw";
  static constexpr const char* kInfoTopic = "/camera/camera_info";
  static constexpr const char* kTruthTopic = "/ground_truth/pose";
  static constexpr const char* kSimulationTopic = "/simulation";
  static constexpr const char* kOdometryTopic = "/odom";
  static constexpr const char* kImuTopic = "/imu";
  static constexpr const char* kBaseFrame = "base_link";
  static constexpr const char* kTruthFrame = "camera_ground_truth";

  /// `compressed`: the images as JPEG on /camera/image_raw/compressed instead.
  CameraBagWriter(const std::string& path, const CameraCalibration& calibration,
                  const std::string& frame_id, bool compressed = false)
      : path_(path), info_(toCameraInfoMsg(calibration)), compressed_(compressed) {
    info_.header.frame_id = frame_id;
    bag_.open(partPath(), rosbag::bagmode::Write);
  }
  ~CameraBagWriter() {
    if (closed_) return;
    try {
      bag_.close();
    } catch (const rosbag::BagException&) {  // a full disk: the file goes in any case
    }
    std::remove(partPath().c_str());
  }
  CameraBagWriter(const CameraBagWriter&) = delete;
  CameraBagWriter& operator=(const CameraBagWriter&) = delete;

  /// A bag refuses time zero, which recordings that count from zero have in their first stamp.
  static ros::Time recordTime(const ros::Time& stamp) { return std::max(stamp, ros::TIME_MIN); }

  /// `image`: CV_8UC1 (mono8), CV_8UC3 (bgr8) or CV_16UC1 (mono16) of the camera's size.
  void writeImage(const ros::Time& stamp, const cv::Mat& image) {
    info_.header.stamp = stamp;
    cv_bridge::CvImage message(info_.header, encoding(image), image);
    if (compressed_) {
      auto jpeg = message.toCompressedImageMsg(cv_bridge::JPG);
      jpeg->format = message.encoding + "; jpeg compressed " + message.encoding;
      bag_.write(std::string(kImageTopic) + "/compressed", recordTime(stamp), jpeg);
    } else {
      bag_.write(kImageTopic, recordTime(stamp), message.toImageMsg());
    }
    bag_.write(kInfoTopic, recordTime(stamp), info_);
    info_.header.seq++;
  }

  /// As tf (world -> camera_ground_truth) and as a pose topic.
  void writeTruth(const ros::Time& stamp, const Eigen::Isometry3d& T_world_camera) {
    geometry_msgs::TransformStamped transform = tf2::eigenToTransform(T_world_camera);
    transform.header.stamp = stamp;
    transform.header.frame_id = "world";
    transform.child_frame_id = kTruthFrame;
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(transform);
    bag_.write("/tf", recordTime(stamp), tf);
    geometry_msgs::PoseStamped pose;
    pose.header = transform.header;
    pose.pose = tf2::toMsg(T_world_camera);
    bag_.write(kTruthTopic, recordTime(stamp), pose);
  }

  /// Where the camera is on the robot, as static tf.
  void writeExtrinsics(const ros::Time& stamp, const Eigen::Isometry3d& T_base_camera) {
    geometry_msgs::TransformStamped transform = tf2::eigenToTransform(T_base_camera);
    transform.header.stamp = stamp;
    transform.header.frame_id = kBaseFrame;
    transform.child_frame_id = info_.header.frame_id;
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(transform);
    bag_.write("/tf_static", recordTime(stamp), tf);
  }

  /// A pose of the robot's base as its odometry has it; without covariances.
  void writeOdometry(const ros::Time& stamp, const Eigen::Isometry3d& T_odom_base) {
    nav_msgs::Odometry odometry;
    odometry.header.stamp = stamp;
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = kBaseFrame;
    odometry.pose.pose = tf2::toMsg(T_odom_base);
    bag_.write(kOdometryTopic, recordTime(stamp), odometry);
  }

  /// In the axes of the robot's base [rad/s, m/s^2]; without an orientation.
  void writeImu(const ros::Time& stamp, const Eigen::Vector3d& angular_velocity,
                const Eigen::Vector3d& acceleration) {
    sensor_msgs::Imu imu;
    imu.header.stamp = stamp;
    imu.header.frame_id = kBaseFrame;
    imu.orientation_covariance[0] = -1.0;
    tf2::toMsg(angular_velocity, imu.angular_velocity);
    tf2::toMsg(acceleration, imu.linear_acceleration);
    bag_.write(kImuTopic, recordTime(stamp), imu);
  }

  /// Marks the bag as simulated, its truth as exact: how it was made, in words.
  void writeSimulation(const ros::Time& stamp, const std::string& description) {
    std_msgs::String text;
    text.data = description;
    bag_.write(kSimulationTopic, recordTime(stamp), text);
  }

  void close() {
    bag_.close();
    closed_ = true;
    if (std::rename(partPath().c_str(), path_.c_str()) != 0) {
      std::remove(partPath().c_str());
      throw rosbag::BagException("cannot write " + path_);
    }
  }

 private:
  std::string partPath() const { return path_ + ".part"; }

  static std::string encoding(const cv::Mat& image) {
    switch (image.type()) {
      case CV_8UC1:
        return sensor_msgs::image_encodings::MONO8;
      case CV_8UC3:
        return sensor_msgs::image_encodings::BGR8;
      case CV_16UC1:
        return sensor_msgs::image_encodings::MONO16;
      default:
        throw std::invalid_argument("image must be CV_8UC1, CV_8UC3 or CV_16UC1");
    }
  }

  std::string path_;
  sensor_msgs::CameraInfo info_;
  bool compressed_;
  rosbag::Bag bag_;
  bool closed_ = false;
};

}  // namespace active_matching_slam
