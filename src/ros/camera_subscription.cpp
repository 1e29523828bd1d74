#include "active_matching_slam/ros/camera_subscription.h"

#include <camera_info_manager/camera_info_manager.h>
#include <image_transport/camera_common.h>
#include <ros/package.h>

#include <algorithm>
#include <cstdlib>
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

bool startsWith(const std::string& text, const std::string& start) {
  return text.rfind(start, 0) == 0;
}
bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// The file of a url as camera_info_manager reads it, or a path. Empty for what only that can read.
std::string pathOfUrl(std::string url) {
  const std::string home = "${ROS_HOME}";
  if (const std::size_t at = url.find(home); at != std::string::npos) {
    const char* const ros_home = std::getenv("ROS_HOME");
    const char* const user = std::getenv("HOME");
    url.replace(at, home.size(),
                ros_home ? std::string(ros_home) : std::string(user ? user : "") + "/.ros");
  }
  if (endsWith(url, ".ini") || url.find("${") != std::string::npos) return "";
  if (startsWith(url, "file://")) return url.substr(7);
  if (!startsWith(url, "package://")) return url;
  const std::size_t slash = url.find('/', 10);
  const std::string package = ros::package::getPath(url.substr(10, slash - 10));
  if (package.empty() || slash == std::string::npos)
    throw std::invalid_argument("camera_info_url = '" + url + "' names no package that is known");
  return package + url.substr(slash);
}

sensor_msgs::CameraInfoConstPtr readCameraInfo(const ros::NodeHandle& node, const std::string& url,
                                               bool rectified) {
  if (url.empty()) return nullptr;
  if (const std::string path = pathOfUrl(url); !path.empty()) {
    try {
      return boost::make_shared<sensor_msgs::CameraInfo>(
          toCameraInfoMsg(readCalibrationYaml(path, rectified)));
    } catch (const std::runtime_error& error) {
      throw std::invalid_argument("camera_info_url = '" + url + "': " + error.what());
    }
  }
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
      base_topic_(resolve(private_node, "image")),
      image_topic_(base_topic_),
      info_topic_(infoTopicOf(private_node, image_topic_)),
      image_transport_(private_node),
      last_image_(ros::WallTime::now()) {
  if (const auto info =
          readCameraInfo(private_node, camera_info_url, isRectifiedTopic(image_topic_)))
    calibration_.take(info, last_image_.toSec());
}

void CameraSubscription::start(const std::string& transport, Callback callback) {
  callback_ = std::move(callback);
  transport_ = transport;
  if (const std::string end = "/" + transport; transport != "raw" && endsWith(base_topic_, end))
    base_topic_.erase(base_topic_.size() - end.size());
  info_subscriber_ = node_.subscribe(info_topic_, 2, &CameraSubscription::onCameraInfo, this);
  image_topic_ = transport == "raw" ? base_topic_ : base_topic_ + "/" + transport;
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
        base_topic_, kSubscriberQueueSize, receive, ros::VoidPtr(),
        image_transport::TransportHints(transport, ros::TransportHints().tcpNoDelay()));
  } else if (transport == "compressed") {
    subscribeCompressed(image_topic_);
  } else {
    std::string names;
    for (const std::string& plugin : plugins) names += " " + plugin.substr(plugin.find('/') + 1);
    throw std::invalid_argument("image_transport = '" + transport +
                                "' is not installed; there are:" + names + " compressed");
  }
  watch_timer_ = node_.createWallTimer(ros::WallDuration(0.5), &CameraSubscription::watch, this);
}

void CameraSubscription::subscribeCompressed(const std::string& topic) {
  const boost::function<void(const sensor_msgs::CompressedImageConstPtr&)> receive =
      [this](const sensor_msgs::CompressedImageConstPtr& message) {
        CameraImage image;
        image.compressed = message;
        deliver(std::move(image));
      };
  compressed_subscriber_ = node_.subscribe<sensor_msgs::CompressedImage>(
      topic, kSubscriberQueueSize, receive, ros::VoidConstPtr(),
      ros::TransportHints().tcpNoDelay());
}

void CameraSubscription::deliver(CameraImage image) {
  image.received = ros::WallTime::now();
  image.rectified = isRectifiedTopic(base_topic_);
  ++received_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    image.info = calibration_.inUse();
    last_image_ = image.received;
    if (first_image_.isZero()) first_image_ = image.received;
  }
  callback_(image);
}

void CameraSubscription::onCameraInfo(const sensor_msgs::CameraInfoConstPtr& info) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (calibration_.take(info, ros::WallTime::now().toSec())) return;
  const auto text = [](const sensor_msgs::CameraInfo& of) {
    std::ostringstream stream;
    stream << of.width << "x" << of.height << " with fx " << of.K[0] << " px";
    return stream.str();
  };
  calibrations_warning_.say("by turns", "two calibrations by turns on " + info_topic_ +
                                            ": used is that of " + text(*calibration_.inUse()) +
                                            ", not that of " + text(*info));
}

std::uint32_t CameraSubscription::publishers() const {
  return compressed_subscriber_ ? compressed_subscriber_.getNumPublishers()
                                : image_subscriber_.getNumPublishers();
}

/// What stands where images are expected: a topic of another type, or images of another transport.
std::string CameraSubscription::whatIsThere() {
  const std::string compressed = "sensor_msgs/CompressedImage";
  ros::master::V_TopicInfo topics;
  if (!ros::master::getTopics(topics)) return "";
  std::string others;
  for (const ros::master::TopicInfo& topic : topics) {
    if (topic.name == base_topic_ && topic.datatype == compressed) {
      if (transport_ != "compressed")
        return ": it has the type " + compressed + ": set image_transport:=compressed";
      subscribeCompressed(base_topic_);
      return ", but compressed images come on " + base_topic_ + ": taking these";
    }
    if (topic.name == image_topic_ && topic.datatype != "sensor_msgs/Image" &&
        topic.datatype != compressed && topic.datatype != "*")
      return ": it has the type " + topic.datatype + ", which is none of images";
    if (topic.name == base_topic_ + "/compressed" && topic.datatype == compressed &&
        transport_ != "compressed")
      return ": nobody publishes it, but " + topic.name + ": set image_transport:=compressed";
    if (topic.datatype == "sensor_msgs/Image" && topic.name != base_topic_ &&
        !startsWith(topic.name, node_.getNamespace() + "/"))
      others += (others.empty() ? "" : ", ") + topic.name;
  }
  return " (remap image?): nobody publishes it" +
         (others.empty() ? "" : "; images come on " + others);
}

std::string CameraSubscription::silence() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::WallTime now = ros::WallTime::now();
  const double silent_s = (now - last_image_).toSec();
  std::ostringstream text;
  if (silent_s >= silence_timeout_s_) {
    text << "No images on " << image_topic_ << " for " << static_cast<int>(silent_s) << " s";
    if (publishers() == 0) {
      text << (there_.empty() ? " (remap image?): nobody publishes it" : there_);
    } else {
      text << ", though it has a publisher";
      if (ros::Time::isSimTime() && ros::Time::now().isZero())
        text << "; use_sim_time is set, but there is no /clock";
    }
  } else if (!calibration_.inUse() && !first_image_.isZero() &&
             (now - first_image_).toSec() > kInfoDelay_s) {
    text << "No camera_info on " << info_topic_ << " (remap camera_info, or set camera_info_url?)";
  }
  return text.str();
}

void CameraSubscription::watch(const ros::WallTimerEvent&) {
  const ros::WallTime start = ros::WallTime::now();
  if (publishers() == 0 && (start - last_look_).toSec() >= silence_timeout_s_) {
    last_look_ = start;
    const std::string there = whatIsThere();
    const std::lock_guard<std::mutex> lock(mutex_);
    there_ = there;
  } else if (publishers() > 1) {
    several_warning_.say("several", std::to_string(publishers()) + " nodes publish images on " +
                                        image_topic_ + ": one camera can be followed there");
  }
  const std::string text = silence();
  const ros::WallTime now = ros::WallTime::now();
  if (text.empty() || (now - last_warning_).toSec() < silence_timeout_s_) return;
  last_warning_ = now;
  ROS_WARN_STREAM(text);
}

}  // namespace active_matching_slam
