#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "active_matching_slam/ros/camera_subscription.h"

namespace active_matching_slam {

/// Hands on each image with the mask that is meant for it. A mask of the stamp of an image is that
/// image's: where such masks come, an image waits for its own, but no longer than until the next
/// image. Any other mask holds from its arrival on. One thread at a time.
class MaskedImages {
 public:
  explicit MaskedImages(CameraSubscription::Callback deliver) : deliver_(std::move(deliver)) {}

  void addImage(CameraImage image);
  void addMask(const sensor_msgs::ImageConstPtr& mask);

 private:
  void release();

  CameraSubscription::Callback deliver_;
  sensor_msgs::ImageConstPtr mask_;     ///< the newest
  std::deque<ros::Time> image_stamps_;  ///< of the last images
  std::optional<CameraImage> waiting_;
  bool comes_with_images_ = false;
};

}  // namespace active_matching_slam
