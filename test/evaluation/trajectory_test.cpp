#include "active_matching_slam/evaluation/trajectory.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "evaluation/test_trajectories.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

class TumFile : public testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }
  Trajectory read(const std::string& text) {
    std::ofstream(path_) << text;
    return readTrajectoryTum(path_);
  }
  std::string path_ = temporaryPath("trajectory.txt");
};

TEST_F(TumFile, TheScalarPartOfTheQuaternionComesLast) {
  // A quarter turn about z takes the camera's x axis to the world's y axis.
  const Trajectory trajectory = read("1.5 1 2 3 0 0 0.70710678 0.70710678\n");
  ASSERT_EQ(trajectory.size(), 1u);
  EXPECT_EQ(trajectory[0].stamp_s, 1.5);
  EXPECT_EQ(trajectory[0].T_world_camera.translation(), Eigen::Vector3d(1, 2, 3));
  const Eigen::Vector3d x_axis = trajectory[0].T_world_camera.linear() * Eigen::Vector3d::UnitX();
  EXPECT_LT((x_axis - Eigen::Vector3d::UnitY()).norm(), 1e-7);
}

TEST_F(TumFile, WhatIsWrittenReadsBack) {
  const Trajectory written = transformed(randomTrajectory(50), 2.0, someRotation(), {5, 6, 7});
  writeTrajectoryTum(path_, written);
  const Trajectory back = readTrajectoryTum(path_);
  ASSERT_EQ(back.size(), written.size());
  for (std::size_t i = 0; i < back.size(); ++i) {
    EXPECT_NEAR(back[i].stamp_s, written[i].stamp_s, 1e-9);
    EXPECT_TRUE(back[i].T_world_camera.isApprox(written[i].T_world_camera, 1e-8));
  }
}

TEST_F(TumFile, CommentsEmptyLinesAndDosLineEndsAreSkipped) {
  EXPECT_EQ(read("# a comment\n\n   \r\n0 0 0 0 0 0 0 1 # home\n  1 0 0 0 0 0 0 1\r\n").size(), 2u);
}

TEST_F(TumFile, FaultsNameFileAndLine) {
  const std::string good = "0 0 0 0 0 0 0 1\n";
  for (const std::string bad :
       {"1 2 3\n", "1 0 0 0 0 0 0 x\n", "1 0 0 0 0 0 0 1 9\n", "1 nan 0 0 0 0 0 1\n"}) {
    const std::string fault = faultOf([&] { read("# comment\n" + good + bad); });
    EXPECT_NE(fault.find(path_ + ": line 3"), std::string::npos) << bad << fault;
  }
  EXPECT_NE(faultOf([&] { read("0 0 0 0 0 0 0 0\n"); }).find("quaternion"), std::string::npos);
  EXPECT_NE(faultOf([] { readTrajectoryTum("/nonexistent/t.txt"); }).find("/nonexistent/t.txt"),
            std::string::npos);
}

TEST_F(TumFile, AFullDiskIsReportedWithTheFilesName) {
  EXPECT_NE(faultOf([] { writeTrajectoryTum("/dev/full", randomTrajectory(3)); }).find("/dev/full"),
            std::string::npos);
  EXPECT_NE(faultOf([] { writeTrajectoryTum("/nonexistent/t.txt", {}); }).find("/nonexistent"),
            std::string::npos);
}

Trajectory stamps(const std::vector<double>& times) {
  Trajectory trajectory(times.size());
  for (std::size_t i = 0; i < times.size(); ++i) trajectory[i].stamp_s = times[i];
  return trajectory;
}
using Pairs = std::vector<std::pair<int, int>>;

TEST(AssociateByStamp, SparseTruthTakesTheNearestEstimate) {
  EXPECT_EQ(associateByStamp(stamps({0.0, 0.033, 0.066, 0.1, 0.133}), stamps({0.001, 0.13})),
            (Pairs{{0, 0}, {4, 1}}));
}

TEST(AssociateByStamp, DenseTruthIsThinnedOut) {
  EXPECT_EQ(associateByStamp(stamps({0.1, 0.2}), stamps({0.09, 0.098, 0.105, 0.15, 0.199, 0.21})),
            (Pairs{{0, 1}, {1, 4}}));
}

TEST(AssociateByStamp, NothingBeyondTheToleranceIsPaired) {
  EXPECT_EQ(associateByStamp(stamps({0.0, 1.0}), stamps({0.021, 1.019})), (Pairs{{1, 1}}));
  EXPECT_EQ(associateByStamp(stamps({0.0, 1.0}), stamps({0.021, 1.019}), 0.03).size(), 2u);
}

TEST(AssociateByStamp, NoPoseIsUsedTwiceEvenWithEqualStamps) {
  EXPECT_EQ(associateByStamp(stamps({0.0, 0.0, 0.005}), stamps({0.0, 0.001})), (Pairs{{0, 0}}));
}

TEST(AssociateByStamp, OrderDoesNotMatter) {
  EXPECT_EQ(associateByStamp(stamps({2.0, 1.0}), stamps({1.0, 3.0, 2.0})), (Pairs{{1, 0}, {0, 2}}));
}

TEST(AssociateByStamp, EmptyTrajectoriesHaveNoPairs) {
  EXPECT_TRUE(associateByStamp({}, stamps({0.0})).empty());
  EXPECT_TRUE(associateByStamp(stamps({0.0}), {}).empty());
}

TEST(MeasureExcursion, OfAWalkOutAndHalfWayBack) {
  Trajectory walk = stamps({0, 1, 2, 3});
  walk[1].T_world_camera.translation() << 3, 4, 0;
  walk[2].T_world_camera.translation() << 6, 8, 0;
  walk[3].T_world_camera.translation() << 3, 4, 0;
  const Excursion result = measureExcursion(walk);
  EXPECT_DOUBLE_EQ(result.displacement, 5.0);
  EXPECT_DOUBLE_EQ(result.excursion, 10.0);
  EXPECT_DOUBLE_EQ(result.path_length, 15.0);
  EXPECT_EQ(measureExcursion({}).path_length, 0.0);
}

}  // namespace
}  // namespace active_matching_slam
