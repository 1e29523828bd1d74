#include "active_matching_slam/ros/one_camera.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace active_matching_slam
