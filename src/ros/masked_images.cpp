#include "active_matching_slam/ros/masked_images.h"

#include <algorithm>
#include <utility>

namespace active_matching_slam {
namespace {

/// Images among which that of a mask's stamp is looked for. Cost: of as many a stamp is kept; a
/// mask that lags by more is not taken for one that comes with each image.
constexpr std::size_t kRememberedImages = 50;

}  // namespace

void MaskedImages::addImage(CameraImage image) {
  if (waiting_) {  // in vain
    comes_with_images_ = false;
    release();
  }
  const ros::Time stamp = image.header().stamp;
  image_stamps_.push_back(stamp);
  if (image_stamps_.size() > kRememberedImages) image_stamps_.pop_front();
  waiting_ = std::move(image);
  if (!comes_with_images_ || mask_->header.stamp >= stamp) release();
}

void MaskedImages::addMask(const sensor_msgs::ImageConstPtr& mask) {
  mask_ = mask;
  comes_with_images_ = std::find(image_stamps_.begin(), image_stamps_.end(), mask->header.stamp) !=
                       image_stamps_.end();
  if (waiting_ && mask->header.stamp >= waiting_->header().stamp) release();
}

void MaskedImages::release() {
  CameraImage image = std::move(*waiting_);
  waiting_.reset();
  image.mask = mask_;
  deliver_(image);
}

}  // namespace active_matching_slam
