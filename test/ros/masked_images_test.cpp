#include "active_matching_slam/ros/masked_images.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {
namespace {

sensor_msgs::ImageConstPtr stamped(double stamp_s) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = ros::Time(stamp_s);
  return image;
}

/// What is handed on, as "image:mask" by their stamps.
class MaskedImagesTest : public testing::Test {
 protected:
  void image(int stamp_s) {
    CameraImage image;
    image.raw = stamped(stamp_s);
    images_.addImage(image);
  }
  void mask(int stamp_s) { images_.addMask(stamped(stamp_s)); }
  std::string delivered() {
    std::string text;
    for (const CameraImage& image : delivered_)
      text += std::to_string(image.header().stamp.sec) + ":" +
              (image.mask ? std::to_string(image.mask->header.stamp.sec) : "-") + " ";
    delivered_.clear();
    return text;
  }

  std::vector<CameraImage> delivered_;
  MaskedImages images_{[this](const CameraImage& image) { delivered_.push_back(image); }};
};

TEST_F(MaskedImagesTest, WithoutMasksImagesGoOnAtOnce) {
  image(1);
  image(2);
  EXPECT_EQ(delivered(), "1:- 2:- ");
}

TEST_F(MaskedImagesTest, AMaskOfItsOwnTimeHoldsFromItsArrivalOn) {
  image(5);
  mask(1);
  image(6);
  image(7);
  EXPECT_EQ(delivered(), "5:- 6:1 7:1 ");
}

TEST_F(MaskedImagesTest, AnImageWaitsForItsMaskWhereMasksComeWithImages) {
  image(1);
  mask(1);
  EXPECT_EQ(delivered(), "1:- ");
  image(2);
  EXPECT_EQ(delivered(), "") << "waits";
  mask(2);
  EXPECT_EQ(delivered(), "2:2 ");
  mask(3);  // this time the mask is first
  image(3);
  EXPECT_EQ(delivered(), "3:3 ");
}

TEST_F(MaskedImagesTest, NoImageWaitsLongerThanForTheNext) {
  image(1);
  mask(1);
  image(2);
  image(3);
  image(4);
  EXPECT_EQ(delivered(), "1:- 2:1 3:1 4:1 ") << "the masks have ended";
  mask(4);
  image(5);
  mask(5);
  EXPECT_EQ(delivered(), "5:5 ");
}

}  // namespace
}  // namespace active_matching_slam
