#pragma once

#include <image_transport/image_transport.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/ros/one_camera.h"
#include "active_matching_slam/ros/repeated_warning.h"

namespace active_matching_slam {

/// An image as it arrived, with the newest calibration known at that moment.
struct CameraImage {
  sensor_msgs::ImageConstPtr raw;  ///< one of these two
  sensor_msgs::CompressedImageConstPtr compressed;
  sensor_msgs::CameraInfoConstPtr info;  ///< null: none yet
  bool rectified = false;                ///< the image is, by what info.P says
  sensor_msgs::ImageConstPtr mask;       ///< null: as before
  ros::WallTime received;

  const std_msgs::Header& header() const { return raw ? raw->header : compressed->header; }
  /// Grey 8-bit copy; throws std::runtime_error, see toGrayImage().
  cv::Mat toGray() const;
};

/// Subscribes to `image` by image_transport and to its camera_info: the topic beside it, or
/// `camera_info` when that is remapped. Says so when nothing comes.
///
/// Both names are relative to the namespace that `private_node` is in: for a nodelet its own, not
/// that of its manager, in which its remappings would not hold.
///
/// Transport 'compressed' works without its plugin: the jpeg or png is decoded here.
class CameraSubscription {
 public:
  using Callback = std::function<void(const CameraImage&)>;

  /// Throws std::invalid_argument or std::runtime_error for a `camera_info_url` that can't be read.
  CameraSubscription(const ros::NodeHandle& private_node, const std::string& camera_info_url,
                     double silence_timeout_s);

  /// `callback` runs in the thread that serves the node's callbacks. Throws std::invalid_argument
  /// for a transport that is not installed.
  void start(const std::string& transport, Callback callback);

  void setSilenceTimeout(double timeout_s) { silence_timeout_s_ = timeout_s; }
  /// What is missing, for example "No images on /camera/image_raw for 5 s (remap image?)"; empty
  /// while all is well. Safe from any thread.
  std::string silence() const;
  std::string imageTopic() const { return image_topic_; }
  std::string infoTopic() const { return info_topic_; }
  std::uint64_t received() const { return received_; }

 private:
  void deliver(CameraImage image);
  void onCameraInfo(const sensor_msgs::CameraInfoConstPtr& info);
  void watch(const ros::WallTimerEvent&);
  void subscribeCompressed(const std::string& topic);
  std::string whatIsThere();
  std::uint32_t publishers() const;

  ros::NodeHandle node_;
  Callback callback_;
  std::atomic<double> silence_timeout_s_;
  std::string base_topic_;  ///< without that of the transport
  std::string image_topic_, info_topic_, transport_;
  image_transport::ImageTransport image_transport_;
  image_transport::Subscriber image_subscriber_;
  ros::Subscriber compressed_subscriber_, info_subscriber_;
  ros::WallTimer watch_timer_;
  ros::WallTime last_look_;  ///< at what is there
  RepeatedWarning several_warning_, calibrations_warning_;
  std::atomic<std::uint64_t> received_{0};
  mutable std::mutex mutex_;  // guards what follows
  OneCalibration calibration_;
  ros::WallTime first_image_, last_image_, last_warning_;
  std::string there_;  ///< found when nobody publishes images on the topic
};

}  // namespace active_matching_slam
