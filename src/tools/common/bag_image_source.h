#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/evaluation/run_sequence.h"
#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/ros/one_camera.h"

namespace active_matching_slam {

/// One recording, which may be cut into several bags.
using Bags = std::vector<std::unique_ptr<rosbag::Bag>>;

/// Opens bags for reading. Throws std::runtime_error naming the file and what is wrong with it:
/// missing, no bag, cut off, without its index (still recording).
Bags openBags(const std::vector<std::string>& paths);

/// The grey images of one topic (sensor_msgs/Image or CompressedImage), in the order of recording
/// over all bags, stamped by their headers (or by the time of recording when a header has no
/// stamp).
class BagImageSource : public ImageSource {
 public:
  /// `bags` outlive the source. `topic` is also found as `topic`/compressed. Throws
  /// std::runtime_error that lists the image topics of the bag, or all where there are none, when
  /// there is no such topic, or no image on it.
  BagImageSource(const Bags& bags, const std::string& topic);

  const std::string& topic() const { return topic_; }
  int size() { return static_cast<int>(view_->size()); }

  /// An image that can't be decoded, or is of another camera on the same topic, is delivered empty;
  /// fault() says why. Throws
  /// std::runtime_error when the bag itself can't be read on.
  bool next(cv::Mat* image, double* stamp_s) override;
  std::string fault() const override { return fault_; }
  bool skip() override;
  /// Those delivered so far that took the time of recording for want of a stamp.
  int imagesWithoutStamp() const { return images_without_stamp_; }

 private:
  const Bags& bags_;
  OneCamera cameras_;
  std::string topic_, fault_;
  std::unique_ptr<rosbag::View> view_;
  rosbag::View::iterator position_;
  int images_without_stamp_ = 0;
};

/// camera_info beside an image topic (image_transport::getCameraInfoTopic): /camera/image_raw and
/// /camera/image_raw/compressed both lead to /camera/camera_info.
std::string cameraInfoTopicOf(const std::string& image_topic);

/// First camera_info on the topic that is calibrated, and what makes one doubt it. `rectified`: of
/// rectified images. Throws std::runtime_error when there is none, or it is at fault.
CameraCalibration readBagCalibration(const Bags& bags, const std::string& topic, bool rectified,
                                     std::vector<std::string>* doubts);

/// True poses on a topic of geometry_msgs/PoseStamped; empty when there is no such topic.
Trajectory readBagTrajectory(const Bags& bags, const std::string& topic);

bool bagHasTopic(const Bags& bags, const std::string& topic);

}  // namespace active_matching_slam
