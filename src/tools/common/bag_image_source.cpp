#include "bag_image_source.h"

#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <cstring>
#include <fstream>
#include <map>
#include <stdexcept>

#include "active_matching_slam/ros/image_conversions.h"

namespace active_matching_slam {
namespace {

const std::string kCompressed = "/compressed";

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::string namesOf(const Bags& bags) {
  std::string names;
  for (const auto& bag : bags) names += (names.empty() ? "" : ", ") + bag->getFileName();
  return names;
}

/// As a node's names are: of the root, where nothing else is said.
std::string absoluteTopic(const std::string& topic) {
  return topic.empty() || topic.front() == '/' ? topic : "/" + topic;
}

/// Messages of a topic, in the order of recording.
std::unique_ptr<rosbag::View> viewOf(const Bags& bags, const std::string& topic) {
  auto view = std::make_unique<rosbag::View>();
  for (const auto& bag : bags) view->addQuery(*bag, rosbag::TopicQuery(absoluteTopic(topic)));
  return view;
}

/// Types by topic.
std::map<std::string, std::string> topicsOf(const Bags& bags) {
  std::map<std::string, std::string> topics;
  rosbag::View view;
  for (const auto& bag : bags) view.addQuery(*bag);
  for (const rosbag::ConnectionInfo* connection : view.getConnections())
    topics[connection->topic] = connection->datatype;
  return topics;
}

bool isImage(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage";
}

std::string findImageTopic(const Bags& bags, const std::string& wanted) {
  const std::map<std::string, std::string> topics = topicsOf(bags);
  for (const std::string& topic : {wanted, wanted + kCompressed}) {
    const auto found = topics.find(topic);
    if (found != topics.end() && isImage(found->second)) return topic;
  }
  std::string images, others;
  for (const auto& [topic, type] : topics) {
    if (isImage(type)) images += (images.empty() ? "" : ", ") + topic;
    others += (others.empty() ? "" : ", ") + topic + " (" + type + ")";
  }
  std::string there = "the bag is empty";
  if (!others.empty()) there = "the bag has no image topic, but " + others;
  if (!images.empty()) there = "image topics there: " + images;
  throw std::runtime_error(namesOf(bags) + ": no images on " + wanted + "; " + there);
}

double stampOf(const std_msgs::Header& header, const ros::Time& recorded) {
  return (header.stamp.isZero() ? recorded : header.stamp).toSec();
}

/// Runs `read`; what rosbag throws about a damaged file then names the file.
template <typename F>
auto reading(const Bags& bags, F read) -> decltype(read()) {
  try {
    return read();
  } catch (const ros::Exception& error) {  // rosbag's and ros::serialization's
    throw std::runtime_error(namesOf(bags) + ": damaged: " + error.what());
  }
}

/// By the first words of its format.
bool isBag(const std::string& path) {
  const std::string format = "#ROSBAG";
  std::string begin(format.size(), ' ');
  std::ifstream(path).read(&begin[0], static_cast<std::streamsize>(begin.size()));
  return begin == format;
}

std::unique_ptr<rosbag::Bag> openBag(const std::string& path) {
  if (!std::ifstream(path)) throw std::runtime_error(path + ": cannot be opened");
  auto bag = std::make_unique<rosbag::Bag>();
  try {
    bag->open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw std::runtime_error(path +
                             ": has no index: still recording, or cut off? ('rosbag reindex')");
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(path +
                             (isBag(path) ? ": not a whole bag: cut off? ('rosbag reindex' "
                                            "saves what is there): "
                                          : ": is no bag: ") +
                             error.what());
  }
  return bag;
}

}  // namespace

Bags openBags(const std::vector<std::string>& paths) {
  Bags bags;
  for (const std::string& path : paths) bags.push_back(openBag(path));
  return bags;
}

BagImageSource::BagImageSource(const Bags& bags, const std::string& topic) : bags_(bags) {
  reading(bags_, [&] {
    topic_ = findImageTopic(bags, absoluteTopic(topic));
    view_ = viewOf(bags, topic_);
    position_ = view_->begin();
  });
}

bool BagImageSource::next(cv::Mat* image, double* stamp_s) {
  return reading(bags_, [&] {
    if (position_ == view_->end()) return false;
    fault_.clear();
    const rosbag::MessageInstance& message = *position_;
    image->release();
    std_msgs::Header header;
    try {
      if (const auto raw = message.instantiate<sensor_msgs::Image>()) {
        header = raw->header;
        *image = toGrayImage(*raw);
      } else if (const auto compressed = message.instantiate<sensor_msgs::CompressedImage>()) {
        header = compressed->header;
        *image = toGrayImage(*compressed);
      }
    } catch (const ros::Exception&) {  // the bag
      throw;
    } catch (const std::runtime_error& error) {  // this image only
      fault_ = error.what();
    }
    const std::string other = cameras_.faultOf(header, message.getCallerId());
    if (!other.empty()) {
      fault_ = other;
      image->release();
    }
    if (header.stamp.isZero()) ++images_without_stamp_;
    *stamp_s = stampOf(header, message.getTime());
    ++position_;
    return true;
  });
}

bool BagImageSource::skip() {
  return reading(bags_, [&] {
    if (position_ == view_->end()) return false;
    ++position_;
    return true;
  });
}

std::string cameraInfoTopicOf(const std::string& image_topic) {
  std::string topic = image_topic;
  for (const char* const transport : {"/compressed", "/compressedDepth", "/theora", "/h264"})
    if (endsWith(topic, transport)) topic.erase(topic.size() - std::strlen(transport));
  const std::size_t slash = topic.rfind('/');
  return (slash == std::string::npos ? "" : topic.substr(0, slash + 1)) + "camera_info";
}

CameraCalibration readBagCalibration(const Bags& bags, const std::string& topic, bool rectified,
                                     std::vector<std::string>* doubts) {
  return reading(bags, [&] {
    const auto view = viewOf(bags, topic);
    std::string fault = "no sensor_msgs/CameraInfo on " + topic;
    for (const rosbag::MessageInstance& message : *view) {
      const auto info = message.instantiate<sensor_msgs::CameraInfo>();
      if (!info) break;
      try {
        const CameraCalibration calibration = toCalibration(*info, rectified);
        *doubts = calibrationDoubts(*info, calibration);
        return calibration;
      } catch (const std::invalid_argument& error) {
        fault = topic + ": " + error.what();
        const bool comes_later = info->K[0] == 0.0;  // of a driver that has not read it yet
        if (!comes_later) break;
      }
    }
    throw std::runtime_error(namesOf(bags) + ": " + fault +
                             " (--camera-info reads a calibration from a file)");
  });
}

Trajectory readBagTrajectory(const Bags& bags, const std::string& topic) {
  return reading(bags, [&] {
    Trajectory trajectory;
    const auto view = viewOf(bags, topic);
    for (const rosbag::MessageInstance& message : *view) {
      const auto pose = message.instantiate<geometry_msgs::PoseStamped>();
      if (!pose) break;
      StampedPose stamped;
      stamped.stamp_s = stampOf(pose->header, message.getTime());
      const auto& q = pose->pose.orientation;
      const auto& t = pose->pose.position;
      stamped.T_world_camera.linear() =
          Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
      stamped.T_world_camera.translation() << t.x, t.y, t.z;
      trajectory.push_back(stamped);
    }
    return trajectory;
  });
}

bool bagHasTopic(const Bags& bags, const std::string& topic) {
  return reading(bags, [&] { return viewOf(bags, topic)->size() > 0; });
}

}  // namespace active_matching_slam
