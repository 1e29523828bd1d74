#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/evaluation/run_sequence.h"
#include "active_matching_slam/evaluation/trajectory.h"

namespace active_matching_slam {

/// Opens a bag for reading. Throws std::runtime_error naming the file and what is wrong with it:
/// missing, no bag, without its index (cut off while recording or copying).
std::unique_ptr<rosbag::Bag> openBag(const std::string& path);

/// The grey images of one topic of a bag (sensor_msgs/Image or CompressedImage), in the order of
/// recording, stamped by their headers (or by the time of recording when a header has no stamp).
class BagImageSource : public ImageSource {
 public:
  /// `bag` outlives the source. `topic` is also found as `topic`/compressed. Throws
  /// std::runtime_error that lists the image topics of the bag when there is no such topic, or no
  /// image on it.
  BagImageSource(const rosbag::Bag& bag, const std::string& topic);

  const std::string& topic() const { return topic_; }
  int size() { return static_cast<int>(view_->size()); }

  /// An image that can't be decoded is delivered empty: the tracker says so in its frame. Throws
  /// std::runtime_error when the bag itself can't be read on.
  bool next(cv::Mat* image, double* stamp_s) override;
  bool skip() override;

 private:
  const rosbag::Bag& bag_;
  std::string topic_;
  std::unique_ptr<rosbag::View> view_;
  rosbag::View::iterator position_;
};

/// camera_info beside an image topic (image_transport::getCameraInfoTopic): /camera/image_raw and
/// /camera/image_raw/compressed both lead to /camera/camera_info.
std::string cameraInfoTopicOf(const std::string& image_topic);

/// First camera_info on the topic. Throws std::runtime_error when there is none, or it is at fault.
CameraCalibration readBagCalibration(const rosbag::Bag& bag, const std::string& topic);

/// True poses on a topic of geometry_msgs/PoseStamped; empty when the bag has no such topic.
Trajectory readBagTrajectory(const rosbag::Bag& bag, const std::string& topic);

bool bagHasTopic(const rosbag::Bag& bag, const std::string& topic);

}  // namespace active_matching_slam
