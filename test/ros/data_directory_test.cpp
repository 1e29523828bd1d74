#include "active_matching_slam/ros/data_directory.h"

#include <gtest/gtest.h>

#include <boost/filesystem.hpp>
#include <fstream>
#include <stdexcept>

#include "active_matching_slam/ros/trajectory_log.h"

namespace active_matching_slam {
namespace {

namespace fs = boost::filesystem;

struct TemporaryFolder {
  fs::path path = fs::temp_directory_path() / fs::unique_path("ams-%%%%-%%%%-%%%%");
  ~TemporaryFolder() { fs::remove_all(path); }
};

TEST(DataDirectory, NamesWithoutAPathLiveInIt) {
  const DataDirectory directory("/data/maps");
  EXPECT_EQ("/data/maps/desk-2.map", directory.resolve("desk-2.map"));
}

TEST(DataDirectory, NoNameLeadsOutOfIt) {
  const DataDirectory directory("/data/maps");
  for (const char* name : {"", ".", "..", "../desk.map", "/etc/passwd", "a/b", "a\\b", ".hidden",
                           "..\\x", "a\nb", "a b", "~desk", "$HOME"})
    EXPECT_THROW(directory.resolve(name), std::invalid_argument) << name;
  EXPECT_THROW(directory.resolve(std::string("a\0b", 3)), std::invalid_argument);
  EXPECT_THROW(directory.resolve(std::string(300, 'a')), std::invalid_argument);
}

TEST(DataDirectory, IsMadeWhenThereIsNone) {
  const TemporaryFolder folder;
  const DataDirectory directory((folder.path / "deep" / "maps").string());
  directory.create();
  EXPECT_TRUE(fs::is_directory(directory.path()));
  EXPECT_NO_THROW(directory.create());
  std::ofstream(directory.resolve("file")) << "x";
  EXPECT_THROW(DataDirectory(directory.resolve("file")).create(), std::runtime_error);
}

TrackedFrame frameAt(double stamp_s, double x) {
  TrackedFrame frame;
  frame.stamp_s = stamp_s;
  frame.camera.position_world << x, 2, 3;
  frame.camera.q_world_camera = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  return frame;
}

TEST(TrajectoryLog, WritesTumLines) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path);
  TrajectoryLog log(10);
  log.add(frameAt(1.25, 0.5));
  const std::string path = (folder.path / "t.txt").string();
  log.save(path);
  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_EQ("1.250000000 0.5 2 3 0.5 -0.5 0.5 0.5", line);
  EXPECT_FALSE(std::getline(file, line));
  EXPECT_EQ(1, std::distance(fs::directory_iterator(folder.path), fs::directory_iterator()));
}

TEST(TrajectoryLog, SaysWhichFileCouldNotBeWritten) {
  TrajectoryLog log(10);
  try {
    log.save("/nonexistent/folder/t.txt");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string::npos, std::string(error.what()).find("/nonexistent/folder/t.txt"));
  }
}

TEST(TrajectoryLog, IsBounded) {
  TrajectoryLog log(5);
  for (int i = 0; i < 20; ++i) log.add(frameAt(i, i));
  EXPECT_EQ(5u, log.size());
  std_msgs::Header header;
  header.frame_id = "world";
  const nav_msgs::Path path = log.path(3, header);
  ASSERT_EQ(3u, path.poses.size());
  EXPECT_EQ(17.0, path.poses.front().pose.position.x);
  EXPECT_EQ(ros::Time(19), path.poses.back().header.stamp);
  EXPECT_EQ("world", path.poses.back().header.frame_id);
}

TEST(TrajectoryLog, FollowsTheScaleOfTheMap) {
  TrajectoryLog log(5);
  log.add(frameAt(1, 2));
  log.rescale(3.0);
  EXPECT_EQ(6.0, log.points(1)[0].position_world.x());
}

}  // namespace
}  // namespace active_matching_slam
