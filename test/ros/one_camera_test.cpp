#include "active_matching_slam/ros/one_camera.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

namespace active_matching_slam {
namespace {

std_msgs::Header headerOf(const std::string& frame_id, double stamp_s) {
  std_msgs::Header header;
  header.frame_id = frame_id;
  header.stamp = ros::Time(stamp_s);
  return header;
}

TEST(OneCamera, IsFollowedAndTheOtherLeftOutByName) {
  OneCamera cameras;
  EXPECT_EQ(cameras.faultOf(headerOf("left", 10.0)), "");
  const std::string fault = cameras.faultOf(headerOf("right", 10.01));
  EXPECT_NE(fault.find("'left'"), std::string::npos) << fault;
  EXPECT_NE(fault.find("'right'"), std::string::npos) << fault;
  EXPECT_EQ(cameras.faultOf(headerOf("left", 10.03)), "");
}

TEST(OneCamera, OfTwoNodesWithOneFrameIsThatOfTheFirst) {
  OneCamera cameras;
  EXPECT_EQ(cameras.faultOf(headerOf("camera", 10.0), "/front"), "");
  EXPECT_NE(cameras.faultOf(headerOf("camera", 10.01), "/rear"), "");
  EXPECT_EQ(cameras.faultOf(headerOf("camera", 10.02), "/front"), "");
}

TEST(OneCamera, UnderAnotherNameIsFollowedAfterAPauseOrAJumpBack) {
  OneCamera cameras;
  cameras.faultOf(headerOf("left", 100.0));
  EXPECT_EQ(cameras.faultOf(headerOf("renamed", 102.0)), "");
  EXPECT_NE(cameras.faultOf(headerOf("left", 102.1)), "");
  EXPECT_EQ(cameras.faultOf(headerOf("left", 5.0)), "");
}

sensor_msgs::CameraInfoConstPtr infoWithFocal(double focal_px) {
  auto info = boost::make_shared<sensor_msgs::CameraInfo>();
  info->K[0] = info->K[4] = focal_px;
  return info;
}

TEST(OneCalibration, IsKeptWhileAnotherComesByTurns) {
  OneCalibration calibration;
  EXPECT_TRUE(calibration.take(infoWithFocal(500.0), 0.0));
  EXPECT_TRUE(calibration.take(infoWithFocal(300.0), 0.03));  // may be a change
  const auto used = calibration.inUse();
  for (double now_s = 0.05; now_s < 5.0; now_s += 0.03) {
    EXPECT_FALSE(calibration.take(infoWithFocal(500.0), now_s));
    EXPECT_TRUE(calibration.take(infoWithFocal(300.0), now_s + 0.01));
    EXPECT_EQ(calibration.inUse(), used);
  }
}

TEST(OneCalibration, ThatChangesIsTakenAtOnceAndAlsoBackAgain) {
  OneCalibration calibration;
  calibration.take(infoWithFocal(500.0), 0.0);
  calibration.take(infoWithFocal(300.0), 10.0);
  EXPECT_EQ(calibration.inUse()->K[0], 300.0);
  for (double now_s = 10.0; now_s < 12.0; now_s += 0.03)
    calibration.take(infoWithFocal(300.0), now_s);
  EXPECT_TRUE(calibration.take(infoWithFocal(500.0), 12.0));
  EXPECT_EQ(calibration.inUse()->K[0], 500.0);
}

}  // namespace
}  // namespace active_matching_slam
