// Runs the executable (its path is compiled in as TRACK_BAG) on small bags of its own making.

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>

#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/map/map_file.h"
#include "tools/camera_bag_writer.h"

namespace active_matching_slam {
namespace {

constexpr int kFrames = 20;
constexpr double kFocal = 150.0;

std::string contentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

struct Outcome {
  int status = -1;
  std::string errors;  ///< stderr without the lines of progress
};

/// A camera that slides sideways along a wall two metres away.
class TrackBag : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = "/tmp/ams_track_bag_" + std::to_string(getpid());
    std::filesystem::create_directories(directory_);
    writeBag(path("slide.bag"), false);
    writeBag(path("compressed.bag"), true);
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(directory_); }

  static std::string path(const std::string& name) { return directory_ + "/" + name; }

  static void writeBag(const std::string& bag_path, bool compressed) {
    CameraCalibration calibration;
    calibration.width = 200;
    calibration.height = 150;
    calibration.fx = calibration.fy = kFocal;
    calibration.cx = 99.5;
    calibration.cy = 74.5;
    cv::Mat wall(200, 320, CV_8UC1);
    cv::RNG random(4);
    random.fill(wall, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(wall, wall, {0, 0}, 2.0);
    cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
    CameraBagWriter bag(bag_path, calibration, "camera", compressed);
    for (int i = 0; i < kFrames; ++i) {
      const ros::Time stamp(1000.0 + i / 30.0);
      const double shift_px = 2.0 * i;
      cv::Mat image;
      cv::getRectSubPix(wall, {calibration.width, calibration.height},
                        cv::Point2d(110.0 + shift_px, 100.0), image);
      bag.writeImage(stamp, image);
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation().x() = 2.0 * shift_px / kFocal;
      bag.writeTruth(stamp, pose);
    }
    bag.close();
  }

  static Outcome run(const std::string& arguments) {
    const std::string command =
        std::string(TRACK_BAG) + " " + arguments + " >/dev/null 2>" + path("stderr.txt");
    const int status = std::system(command.c_str());
    Outcome outcome;
    outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    std::istringstream lines(contentOf(path("stderr.txt")));
    for (std::string line; std::getline(lines, line);)
      if (line.find(" matched") == std::string::npos) outcome.errors += line + "\n";
    return outcome;
  }
  static Outcome track(const std::string& bag, const std::string& more, const std::string& output) {
    return run("--bag " + path(bag) + " --output " + path(output) + " " + more);
  }
  static nlohmann::json summary(const std::string& output) {
    return nlohmann::json::parse(contentOf(path(output) + "/summary.json"));
  }

  /// statistics.csv without the columns of durations.
  static std::string countsOf(const std::string& output) {
    std::istringstream lines(contentOf(path(output) + "/statistics.csv"));
    std::vector<bool> keep;
    std::string text;
    for (std::string line; std::getline(lines, line);) {
      const bool header = keep.empty();
      std::istringstream cells(line + ",");
      std::size_t i = 0;
      for (std::string cell; std::getline(cells, cell, ','); ++i) {
        if (header) keep.push_back(cell.size() < 3 || cell.substr(cell.size() - 3) != "_ms");
        if (keep.at(i)) text += cell + ",";
      }
      text += "\n";
    }
    return text;
  }

  static void expectFault(const Outcome& outcome, const std::string& part) {
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(std::count(outcome.errors.begin(), outcome.errors.end(), '\n'), 1) << outcome.errors;
    EXPECT_NE(outcome.errors.find(part), std::string::npos) << outcome.errors;
  }

  static std::string directory_;
};
std::string TrackBag::directory_;

TEST_F(TrackBag, TracksABagAndWritesItsFourFiles) {
  const Outcome outcome = track("slide.bag", "", "run");
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_EQ(summary("run")["frames"], kFrames);
  EXPECT_EQ(summary("run")["frames_tracked"], kFrames);
  EXPECT_EQ(summary("run")["truth_pairs"], kFrames);
  const Trajectory trajectory = readTrajectoryTum(path("run/trajectory.txt"));
  ASSERT_EQ(trajectory.size(), static_cast<std::size_t>(kFrames));
  EXPECT_NEAR(trajectory.back().stamp_s, 1000.0 + (kFrames - 1) / 30.0, 1e-6);
  EXPECT_TRUE(std::filesystem::exists(path("run/statistics.csv")));
  EXPECT_TRUE(std::filesystem::exists(path("run/trajectory.png")));
  EXPECT_TRUE(summary("run")["nees_mean"].is_null());
}

TEST_F(TrackBag, LeavesTheMapAndABagOfWhatANodePublishes) {
  ASSERT_EQ(track("slide.bag", "--output-bag", "kept").status, 0);
  rosbag::Bag bag(path("kept/tracked.bag"));
  for (const char* topic : {"/tracker/pose", "/tracker/odometry", "/tracker/state", "/tracker/map",
                            "/tracker/statistics", "/tf"})
    EXPECT_EQ(rosbag::View(bag, rosbag::TopicQuery(topic)).size(),
              static_cast<std::uint32_t>(kFrames))
        << topic;
  const Trajectory trajectory = readTrajectoryTum(path("kept/trajectory.txt"));
  rosbag::View poses(bag, rosbag::TopicQuery("/tf"));
  std::size_t i = 0;
  for (const rosbag::MessageInstance& instance : poses) {
    const auto& transform = instance.instantiate<tf2_msgs::TFMessage>()->transforms.front();
    EXPECT_NEAR(transform.transform.translation.x, trajectory[i++].T_world_camera.translation().x(),
                1e-6);
  }
  EXPECT_FALSE(readMapFile(path("kept/final.map")).map.empty());
}

TEST_F(TrackBag, TheAnnotatedVideoShowsTheSearchesInTheirOrder) {
  ASSERT_EQ(track("slide.bag", "--matcher active --annotate", "annotated").status, 0);
  cv::VideoCapture video(path("annotated/annotated.avi"));
  cv::Mat picture;
  int frames = 0, cyan = 0, magenta = 0;
  for (cv::Mat next; video.read(next); ++frames) picture = next.clone();
  EXPECT_EQ(frames, kFrames);
  ASSERT_GT(picture.rows, 600) << "four times as large, and a legend";
  for (int y = 0; y < 600; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3b bgr = picture.at<cv::Vec3b>(y, x);
      cyan += bgr[0] > bgr[2] + 80 && bgr[1] > bgr[2] + 80;
      magenta += bgr[0] > bgr[1] + 80 && bgr[2] > bgr[1] + 80;
    }
  EXPECT_GT(cyan, 20);
  EXPECT_GT(magenta, 20);
}

TEST_F(TrackBag, TheSameRunGivesTheSameResultBitForBit) {
  ASSERT_EQ(track("slide.bag", "", "first").status, 0);
  ASSERT_EQ(track("slide.bag", "", "second").status, 0);
  EXPECT_EQ(contentOf(path("first/trajectory.txt")), contentOf(path("second/trajectory.txt")));
  EXPECT_EQ(contentOf(path("first/trajectory.png")), contentOf(path("second/trajectory.png")));
  EXPECT_EQ(countsOf("first"), countsOf("second"));
}

TEST_F(TrackBag, CompressedImagesAreFoundUnderTheRawTopicsName) {
  ASSERT_EQ(track("compressed.bag", "--image-topic /camera/image_raw", "compressed").status, 0);
  EXPECT_EQ(summary("compressed")["frames_tracked"], kFrames);
}

TEST_F(TrackBag, EveryAndMaxFramesThinTheRunOut) {
  ASSERT_EQ(track("slide.bag", "--every 3 --max-frames 5", "thin").status, 0);
  EXPECT_EQ(summary("thin")["frames"], 5);
  EXPECT_NEAR(summary("thin")["duration_s"].get<double>(), 12.0 / 30.0, 1e-6);
}

TEST_F(TrackBag, EveryMatcherCanBeAskedForByName) {
  for (const std::string matcher : {"active_search", "jcbb", "active", "chow_liu"}) {
    ASSERT_EQ(track("slide.bag", "--max-frames 6 --matcher " + matcher, matcher).status, 0);
    EXPECT_EQ(summary(matcher)["matcher"], matcher);
  }
}

TEST_F(TrackBag, TruthFromAFileReplacesTheBags) {
  Trajectory truth(3);
  for (int i = 0; i < 3; ++i) truth[i].stamp_s = 1000.0 + i / 3.0;
  writeTrajectoryTum(path("truth.txt"), truth);
  ASSERT_EQ(track("slide.bag", "--ground-truth " + path("truth.txt"), "file_truth").status, 0);
  EXPECT_EQ(summary("file_truth")["truth_pairs"], 2);
}

TEST_F(TrackBag, SimulatedTruthBringsTheNees) {
  ASSERT_EQ(track("slide.bag", "--simulated", "simulated").status, 0);
  EXPECT_TRUE(summary("simulated")["nees_mean"].is_number());
}

TEST_F(TrackBag, FaultsOfTheBagAreNamedInOneLine) {
  expectFault(track("missing.bag", "", "x"), path("missing.bag"));
  const std::string whole = contentOf(path("slide.bag"));
  std::ofstream(path("cut.bag"), std::ios::binary) << whole.substr(0, whole.size() / 2);
  expectFault(track("cut.bag", "", "x"), path("cut.bag"));
  std::ofstream(path("empty.bag"), std::ios::binary);
  expectFault(track("empty.bag", "", "x"), path("empty.bag"));
  std::ofstream(path("text.bag")) << "no bag at all\n";
  expectFault(track("text.bag", "", "x"), path("text.bag"));
  std::string damaged = whole;
  std::fill_n(damaged.begin() + damaged.size() / 4, damaged.size() / 2, 'Z');
  std::ofstream(path("damaged.bag"), std::ios::binary) << damaged;
  expectFault(track("damaged.bag", "", "x"), path("damaged.bag"));
}

TEST_F(TrackBag, ATopicThatIsNotThereBringsTheListOfThoseThatAre) {
  expectFault(track("slide.bag", "--image-topic /left/image", "x"), "/camera/image_raw");
  expectFault(track("slide.bag", "--camera-info-topic /left/info", "x"), "/left/info");
  expectFault(track("slide.bag", "--ground-truth-topic /vicon", "x"), "/vicon");
}

TEST_F(TrackBag, FaultsOfTheSettingsAreNamedInOneLine) {
  expectFault(track("slide.bag", "--matcher potato", "x"), "potato");
  expectFault(track("slide.bag", "--every 0", "x"), "every");
  expectFault(track("slide.bag", "--features -3", "x"), "features");
  expectFault(track("slide.bag", "--set map/potato=3", "x"), "potato");
  expectFault(track("slide.bag", "--config /nonexistent.yaml", "x"), "/nonexistent.yaml");
  expectFault(track("slide.bag", "--known-target /nonexistent.yaml", "x"), "/nonexistent.yaml");
  expectFault(track("slide.bag", "--ground-truth /nonexistent.txt", "x"), "/nonexistent.txt");
  expectFault(run("--bag " + path("slide.bag")), "output");
  expectFault(run("--bag " + path("slide.bag") + " --output /dev/null/x"), "/dev/null/x");
}

}  // namespace
}  // namespace active_matching_slam
