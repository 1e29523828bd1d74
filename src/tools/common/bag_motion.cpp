#include "bag_motion.h"

#include <rosbag/view.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <iostream>
#include <stdexcept>

#include "active_matching_slam/ros/frame_name.h"
#include "active_matching_slam/ros/motion_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {
namespace {

template <class Use>
void forEachMessage(const Bags& bags, const std::string& topic, Use use) {
  rosbag::View view;
  for (const auto& bag : bags) view.addQuery(*bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& message : view)
    if (!use(message)) return;
}

/// Adds what a topic has; returns the frame whose motion it is.
std::string readSamples(const Bags& bags, const std::string& topic, bool is_gyro,
                        MotionHistory* history) {
  std::string frame, fault;
  int samples = 0, faulty = 0;
  forEachMessage(bags, topic, [&](const rosbag::MessageInstance& message) {
    std::string wrong;
    try {
      if (const auto imu = is_gyro ? message.instantiate<sensor_msgs::Imu>() : nullptr) {
        frame = imu->header.frame_id;
        GyroSample sample = fromImuMsg(*imu);
        if (imu->header.stamp.isZero()) sample.stamp_s = message.getTime().toSec();
        wrong = history->add(sample);
      } else if (const auto odometry =
                     is_gyro ? nullptr : message.instantiate<nav_msgs::Odometry>()) {
        frame = odometry->child_frame_id;
        OdometrySample sample = fromOdometryMsg(*odometry);
        if (odometry->header.stamp.isZero()) sample.stamp_s = message.getTime().toSec();
        wrong = history->add(sample);
      } else {
        throw std::runtime_error(topic + " is " + message.getDataType() + ", not " +
                                 (is_gyro ? "sensor_msgs/Imu" : "nav_msgs/Odometry"));
      }
    } catch (const std::invalid_argument& error) {
      wrong = error.what();
    }
    ++samples;
    if (!wrong.empty()) ++faulty, fault = wrong;
    return true;
  });
  if (samples == 0)
    throw std::runtime_error(bags.front()->getFileName() + ": nothing on " + topic + " (" +
                             (is_gyro ? "--imu-topic" : "--odometry-topic") + ")");
  if (faulty > 0)
    std::cerr << topic << ": " << faulty << " of " << samples << " messages: " << fault << "\n";
  return withoutLeadingSlash(frame);
}

Eigen::Isometry3d cameraOn(const Bags& bags, const std::string& base, const std::string& camera,
                           const std::string& topic) {
  if (base == camera) return Eigen::Isometry3d::Identity();
  tf2::BufferCore buffer;
  for (const std::string tf_topic : {"/tf_static", "/tf"}) {
    forEachMessage(bags, tf_topic, [&](const rosbag::MessageInstance& message) {
      const auto tf = message.instantiate<tf2_msgs::TFMessage>();
      if (!tf) return true;
      for (const auto& transform : tf->transforms)
        buffer.setTransform(transform, "bag", tf_topic == "/tf_static");
      return !buffer.canTransform(base, camera, ros::Time(0));
    });
    try {
      return fromTransformMsg(buffer.lookupTransform(base, camera, ros::Time(0)).transform);
    } catch (const tf2::TransformException&) {  // not there
    }
  }
  throw std::runtime_error(bags.front()->getFileName() + ": no transform from '" + base +
                           "', whose motion " + topic + " is, to '" + camera +
                           "', the images' frame, on /tf_static (images_to_bag --extrinsics, "
                           "static_transform_publisher)");
}

}  // namespace

std::string readBagImageFrame(const Bags& bags, const std::string& image_topic) {
  std::string frame;
  forEachMessage(bags, image_topic, [&](const rosbag::MessageInstance& message) {
    if (const auto raw = message.instantiate<sensor_msgs::Image>())
      frame = raw->header.frame_id;
    else if (const auto compressed = message.instantiate<sensor_msgs::CompressedImage>())
      frame = compressed->header.frame_id;
    return false;
  });
  return withoutLeadingSlash(frame);
}

std::shared_ptr<const MotionHistory> readBagMotion(const Bags& bags, const std::string& topic,
                                                   const std::string& camera_frame,
                                                   const MotionOptions& options) {
  if (!options.hasOdometry() && !options.hasGyro()) return nullptr;
  auto history = std::make_shared<MotionHistory>(options);
  const std::string base = readSamples(bags, topic, options.hasGyro(), history.get());
  history->setCamera(cameraOn(bags, base, camera_frame, topic));
  return history;
}

}  // namespace active_matching_slam
