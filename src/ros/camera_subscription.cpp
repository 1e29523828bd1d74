#include "active_matching_slam/ros/camera_subscription.h"

#include <camera_info_manager/camera_info_manager.h>
#include <image_transport/camera_common.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "active_matching_slam/ros/image_conversions.h"

namespace active_matching_slam {
namespace {

/// An image is only handed on, so that a queue is no delay. It is long so that what the worker
/// leaves behind is counted there, and not lost unseen here while a service is answered.
constexpr int kSubscriberQueueSize = 50;
/// camera_info may come a little later than the first image.
constexpr double kInfoDelay_s = 2.0;

sensor_msgs::CameraInfoConstPtr readCameraInfo(const ros::NodeHandle& node,
                                               const std::string& url) {
  if (url.empty()) return nullptr;
  // Lives only while the file is read: the service it offers is the camera driver's business.
  camera_info_manager::CameraInfoManager manager(ros::NodeHandle(node, "camera_info_file"),
                                                 "camera", url);
  if (!manager.isCalibrated())
    throw std::invalid_argument("camera_info_url = '" + url + "' can't be read");
  return boost::make_shared<sensor_msgs::CameraInfo>(manager.getCameraInfo());
}

/// A name beside the node, before and after remapping.
std::string nameBeside(const ros::NodeHandle& private_node, const std::string& name) {
  return ros::names::append(ros::names::parentNamespace(private_node.getNamespace()), name);
}
std::string resolve(const ros::NodeHandle& private_node, const std::string& name) {
  return private_node.resolveName(nameBeside(private_node, name));
}

std::string infoTopicOf(const ros::NodeHandle& private_node, const std::string& image_topic) {
  const std::string topic = resolve(private_node, "camera_info");
  const bool remapped = topic != nameBeside(private_node, "camera_info");
  return remapped ? topic : image_transport::getCameraInfoTopic(image_topic);
}

}  // namespace

cv::Mat CameraImage::toGray() const { return raw ? toGrayImage(*raw) : toGrayImage(*compressed); }

CameraSubscription::CameraSubscription(const ros::NodeHandle& private_node,
                                       const std::string& camera_info_url, double silence_timeout_s)
    : node_(private_node),
      silence_timeout_s_(silence_timeout_s),
      image_topic_(resolve(private_node, "image")),
      info_topic_(infoTopicOf(private_node, image_topic_)),
      image_transport_(private_node),
      info_(readCameraInfo(private_node, camera_info_url)),
      last_image_(ros::WallTime::now()) {}

void CameraSubscription::start(const std::string& transport, Callback callback) {
  callback_ = std::move(callback);
  info_subscriber_ = node_.subscribe(info_topic_, 2, &CameraSubscription::onCameraInfo, this);
  const std::string base_topic = image_topic_;
  if (transport != "raw") image_topic_ += "/" + transport;
  const auto plugins = image_transport_.getLoadableTransports();
  const bool installed =
      std::find(plugins.begin(), plugins.end(), "image_transport/" + transport) != plugins.end();
  if (installed) {
    const boost::function<void(const sensor_msgs::ImageConstPtr&)> receive =
        [this](const sensor_msgs::ImageConstPtr& message) {
          CameraImage image;
          image.raw = message;
          deliver(std::move(image));
        };
    image_subscriber_ = image_transport_.subscribe(
        base_topic, kSubscriberQueueSize, receive, ros::VoidPtr(),
        image_transport::TransportHints(transport, ros::TransportHints().tcpNoDelay()));
  } else if (transport == "compressed") {
    const boost::function<void(const sensor_msgs::CompressedImageConstPtr&)> receive =
        [this](const sensor_msgs::CompressedImageConstPtr& message) {
          CameraImage image;
          image.compressed = message;
          deliver(std::move(image));
        };
    compressed_subscriber_ = node_.subscribe<sensor_msgs::CompressedImage>(
        image_topic_, kSubscriberQueueSize, receive, ros::VoidConstPtr(),
        ros::TransportHints().tcpNoDelay());
  } else {
    std::string names;
    for (const std::string& plugin : plugins) names += " " + plugin.substr(plugin.find('/') + 1);
    throw std::invalid_argument("image_transport = '" + transport +
                                "' is not installed; there are:" + names + " compressed");
  }
  watch_timer_ = node_.createWallTimer(ros::WallDuration(0.5), &CameraSubscription::watch, this);
}

void CameraSubscription::deliver(CameraImage image) {
  image.received = ros::WallTime::now();
  ++received_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    image.info = info_;
    last_image_ = image.received;
    if (first_image_.isZero()) first_image_ = image.received;
  }
  callback_(image);
}

void CameraSubscription::onCameraInfo(const sensor_msgs::CameraInfoConstPtr& info) {
  const std::lock_guard<std::mutex> lock(mutex_);
  // The same pointer for the same calibration: a comparison of pointers then detects a change.
  if (!info_ || !sameCalibration(*info_, *info)) info_ = info;
}

std::uint32_t CameraSubscription::publishers() const {
  return compressed_subscriber_ ? compressed_subscriber_.getNumPublishers()
                                : image_subscriber_.getNumPublishers();
}

std::string CameraSubscription::silence() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::WallTime now = ros::WallTime::now();
  const double silent_s = (now - last_image_).toSec();
  std::ostringstream text;
  if (silent_s >= silence_timeout_s_) {
    text << "No images on " << image_topic_ << " for " << static_cast<int>(silent_s) << " s";
    if (publishers() == 0) {
      text << " (remap image?): nobody publishes it";
    } else {
      text << ", though it has a publisher";
      if (ros::Time::isSimTime() && ros::Time::now().isZero())
        text << "; use_sim_time is set, but there is no /clock";
    }
  } else if (!info_ && !first_image_.isZero() && (now - first_image_).toSec() > kInfoDelay_s) {
    text << "No camera_info on " << info_topic_ << " (remap camera_info, or set camera_info_url?)";
  }
  return text.str();
}

void CameraSubscription::watch(const ros::WallTimerEvent&) {
  const std::string text = silence();
  const ros::WallTime now = ros::WallTime::now();
  if (text.empty() || (now - last_warning_).toSec() < silence_timeout_s_) return;
  last_warning_ = now;
  ROS_WARN_STREAM(text);
}

}  // namespace active_matching_slam
