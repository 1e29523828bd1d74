// track_bag on bags as they come from the field: what is wrong is named, and nothing is silently
// worse for it.

#include <cv_bridge/cv_bridge.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/ros/image_conversions.h"
#include "support/run_program.h"

namespace active_matching_slam {
namespace {

constexpr int kFieldImages = 24;

/// One image and its calibration, as they go into the bag.
struct Recorded {
  sensor_msgs::Image image;
  sensor_msgs::CameraInfo info;
  std::string topic = "/camera/image_raw";
  std::string caller = "/driver";
  ros::Time time;
};
using Change = std::function<void(int, Recorded*)>;

/// A camera that slides sideways along a wall.
class FieldBags : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/field_bags_" + std::to_string(::getpid());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return folder_ + "/" + name; }

  static Recorded recordedOf(int i) {
    static const cv::Mat wall = [] {
      cv::Mat made(200, 320, CV_8UC1);
      cv::RNG random(4);
      random.fill(made, cv::RNG::UNIFORM, 0, 255);
      cv::GaussianBlur(made, made, {0, 0}, 2.0);
      cv::normalize(made, made, 0, 255, cv::NORM_MINMAX);
      return made;
    }();
    CameraCalibration calibration;
    calibration.width = 200;
    calibration.height = 150;
    calibration.fx = calibration.fy = 150.0;
    calibration.cx = 99.5;
    calibration.cy = 74.5;
    cv::Mat shown;
    cv::getRectSubPix(wall, {200, 150}, cv::Point2d(110.0 + 2.0 * i, 100.0), shown);
    Recorded recorded;
    recorded.info = toCameraInfoMsg(calibration);
    recorded.info.header.frame_id = "camera";
    recorded.info.header.stamp = recorded.time = ros::Time(1000.0 + i / 30.0);
    cv_bridge::CvImage(recorded.info.header, "mono8", shown).toImageMsg(recorded.image);
    return recorded;
  }

  void write(const std::string& name, const Change& change, int begin = 0, int end = kFieldImages) {
    rosbag::Bag bag(path(name), rosbag::bagmode::Write);
    for (int i = begin; i < end; ++i) {
      Recorded recorded = recordedOf(i);
      change(i, &recorded);
      const auto header = boost::make_shared<ros::M_string>();
      (*header)["callerid"] = recorded.caller;
      (*header)["topic"] = recorded.topic;
      (*header)["type"] = "sensor_msgs/Image";
      (*header)["md5sum"] = ros::message_traits::MD5Sum<sensor_msgs::Image>::value();
      (*header)["message_definition"] =
          ros::message_traits::Definition<sensor_msgs::Image>::value();
      bag.write("/camera/camera_info", recorded.time, recorded.info);
      bag.write(recorded.topic, recorded.time, recorded.image, header);
    }
  }

  ProgramOutcome track(const std::string& bags, const std::string& more = "") const {
    std::string list;
    for (std::size_t at = 0, next; at < bags.size(); at = next + 1) {
      next = std::min(bags.find(' ', at), bags.size());
      list += " " + path(bags.substr(at, next - at));
    }
    return runProgram(TRACK_BAG, "--bag" + list + " --output " + path("run") + " " + more);
  }
  nlohmann::json summary() const {
    std::ifstream file(path("run/summary.json"));
    return nlohmann::json::parse(file);
  }
  static bool says(const ProgramOutcome& outcome, const std::string& text) {
    return outcome.output.find(text) != std::string::npos;
  }
#define EXPECT_SAYS(outcome, text) EXPECT_TRUE(says(outcome, text)) << (outcome).output

  std::string folder_;
};

TEST_F(FieldBags, SeveralAreOneRecordingInTheOrderOfTheirTime) {
  const Change same = [](int, Recorded*) {};
  write("run_1.bag", same, 12, kFieldImages);
  write("run_0.bag", same, 0, 12);
  for (const std::string bags : {"run_0.bag run_1.bag", "run_1.bag run_0.bag"}) {
    const ProgramOutcome outcome = track(bags);
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    EXPECT_EQ(summary()["frames_tracked"], kFieldImages) << bags;
    EXPECT_EQ(summary()["late_images"], 0) << bags;
  }
}

TEST_F(FieldBags, WordsThatBelongToNoOptionAreRefused) {
  write("run.bag", [](int, Recorded*) {});
  const ProgramOutcome outcome = runProgram(
      TRACK_BAG, path("run.bag") + " --bag " + path("run.bag") + " --output " + path("run"));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_SAYS(outcome, "'" + path("run.bag") + "'");
}

TEST_F(FieldBags, ALateImageIsLeftOutAndToldInTheSummary) {
  write("late.bag", [](int i, Recorded* recorded) {
    if (i == 12) recorded->image.header.stamp = ros::Time(1000.0 + 10.5 / 30.0);
  });
  const ProgramOutcome outcome = track("late.bag");
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_EQ(summary()["resets"], 0);
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages - 1);
  EXPECT_SAYS(outcome, "1 late images left out");
}

TEST_F(FieldBags, AStepBackIsAResetAndToldInTheSummary) {
  write("loop.bag", [](int i, Recorded* recorded) {
    if (i >= 12) recorded->image.header.stamp -= ros::Duration(100.0);
  });
  const ProgramOutcome outcome = track("loop.bag");
  EXPECT_EQ(summary()["resets"], 1);
  EXPECT_SAYS(outcome, "started anew 1 times");
}

TEST_F(FieldBags, WhereNoFrameIsTrackedThatIsAFaultWithItsReason) {
  write("unreadable.bag", [](int, Recorded* recorded) { recorded->image.encoding = "32FC1"; });
  const ProgramOutcome outcome = track("unreadable.bag");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_SAYS(outcome, "no frame was tracked");
  EXPECT_SAYS(outcome, "step");  // that of its encoding
  std::ifstream table(path("run/statistics.csv"));
  const std::string text{std::istreambuf_iterator<char>(table), {}};
  EXPECT_EQ(text.find("the image is empty"), std::string::npos);
}

TEST_F(FieldBags, WhyFramesAreNotTrackedIsToldInTheSummary) {
  write("repeated.bag", [](int i, Recorded* recorded) {
    if (i % 3 == 1) recorded->image.header.stamp = recordedOf(i - 1).image.header.stamp;
  });
  EXPECT_SAYS(track("repeated.bag"), "8 frames not tracked, most often: image ignored: the stamp");
  EXPECT_NE(summary()["untracked_reason"].get<std::string>().find("equals"), std::string::npos);
  write("sizes.bag", [](int i, Recorded* recorded) {
    if (i % 2 == 0) return;
    recorded->image.height = 75;
    recorded->image.data.resize(75 * recorded->image.step);
  });
  EXPECT_SAYS(track("sizes.bag"), "the image is 200 x 75, the calibration 200 x 150");
  EXPECT_GT(summary()["ms"]["total"]["median"].get<double>(), 0.0);  // of those tracked
}

TEST_F(FieldBags, ImagesOfTwoCamerasThatCantBeToldApartAreNotCalledTracked) {
  write("two.bag", [](int i, Recorded* recorded) {
    if (i % 2 == 0) return;
    cv::Mat turned(150, 200, CV_8UC1, recorded->image.data.data());
    cv::flip(turned, turned, -1);
  });
  const ProgramOutcome outcome = track("two.bag");
  EXPECT_LE(summary()["frames_tracked"], 2);
  EXPECT_SAYS(outcome, "two cameras on one topic");
}

TEST_F(FieldBags, WithoutStampsTheTimeOfRecordingIsTakenAndThatIsTold) {
  write("no_stamps.bag",
        [](int, Recorded* recorded) { recorded->image.header.stamp = ros::Time(); });
  EXPECT_SAYS(track("no_stamps.bag"), "24 images have no stamp");
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages);
}

TEST_F(FieldBags, ATopicMayLackItsSlash) {
  write("run.bag", [](int, Recorded*) {});
  EXPECT_EQ(track("run.bag", "--image-topic camera/image_raw").status, 0);
  EXPECT_EQ(track("run.bag", "--camera-info-topic camera/camera_info").status, 0);
}

TEST_F(FieldBags, WhereNoTopicIsOfImagesAllAreNamed) {
  write("run.bag", [](int, Recorded* recorded) { recorded->topic = "/left/image_raw"; });
  EXPECT_SAYS(track("run.bag"), "image topics there: /left/image_raw");
  rosbag::Bag bag(path("none.bag"), rosbag::bagmode::Write);
  bag.write("/camera/camera_info", ros::Time(1000.0), recordedOf(0).info);
  bag.close();
  EXPECT_SAYS(track("none.bag"), "but /camera/camera_info (sensor_msgs/CameraInfo)");
}

TEST_F(FieldBags, AFileThatIsCutOffOrNoneIsNamed) {
  write("whole.bag", [](int, Recorded*) {});
  std::filesystem::copy_file(path("whole.bag"), path("cut.bag"));
  std::filesystem::resize_file(path("cut.bag"), std::filesystem::file_size(path("cut.bag")) / 2);
  EXPECT_SAYS(track("cut.bag"), path("cut.bag") + ": not a whole bag");
  EXPECT_SAYS(track("cut.bag"), "rosbag reindex");
  std::ofstream(path("text.bag")) << "a page of text\n";
  EXPECT_SAYS(track("text.bag"), path("text.bag") + ": is no bag");
}

TEST_F(FieldBags, ATruthWithoutPosesOrOfAnotherTimeIsNamed) {
  write("run.bag", [](int, Recorded*) {});
  std::ofstream(path("none.txt")) << "# stamp x y z qx qy qz qw\n";
  EXPECT_SAYS(track("run.bag", "--ground-truth " + path("none.txt")), "there is no pose in it");
  std::ofstream(path("later.txt")) << "2000 0 0 0 0 0 0 1\n2001 1 0 0 0 0 0 1\n";
  const ProgramOutcome outcome = track("run.bag", "--ground-truth " + path("later.txt"));
  EXPECT_EQ(outcome.status, 0);
  EXPECT_SAYS(outcome, "no true pose is within");
}

TEST_F(FieldBags, ACalibrationThatIsZeroAtFirstIsWaitedFor) {
  write("zero.bag", [](int i, Recorded* recorded) {
    if (i < 5) recorded->info.K.fill(0.0);
  });
  EXPECT_EQ(track("zero.bag").status, 0);
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages);
}

TEST_F(FieldBags, ACalibrationThatCanHardlyBeRightStopsUnlessToldToGoOn) {
  write("normalised.bag", [](int, Recorded* recorded) {
    for (double& number : recorded->info.K) number /= 200.0;
    recorded->info.K[8] = 1.0;
  });
  const ProgramOutcome outcome = track("normalised.bag");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_SAYS(outcome, "can hardly be right: fx = 0.75 px");
  EXPECT_SAYS(outcome, "--accept-calibration");
  EXPECT_SAYS(track("normalised.bag", "--accept-calibration"), "can hardly be right");
}

TEST_F(FieldBags, WhereThereIsNoCalibrationTheOptionIsNamed) {
  write("run.bag", [](int, Recorded* recorded) { recorded->info.K.fill(0.0); });
  EXPECT_SAYS(track("run.bag"), "--camera-info");
  EXPECT_SAYS(track("run.bag", "--camera-info-topic /none"), "--camera-info reads");
}

TEST_F(FieldBags, RectifiedImagesAreThoseOfTheProjection) {
  write("rect.bag", [](int, Recorded* recorded) {
    recorded->topic = "/camera/image_rect";
    recorded->info.K[0] = 400.0;  // of the raw images, which are not in the bag
    recorded->info.D = {-0.4, 0.2, 0.0, 0.0, 0.0};
    recorded->info.distortion_model = "plumb_bob";
  });
  ASSERT_EQ(track("rect.bag", "--image-topic /camera/image_rect").status, 0);
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages);
  std::ifstream map(path("run/final.map"));
  EXPECT_TRUE(map.good());
}

TEST_F(FieldBags, TheImagesOfASecondCameraAreLeftOutByNameAndDoNotCount) {
  write("two.bag", [](int i, Recorded* recorded) {
    if (i % 2 == 0) return;
    recorded->image.header.frame_id = "right";
    for (std::uint8_t& pixel : recorded->image.data) pixel = std::uint8_t(255 - pixel);
  });
  EXPECT_EQ(track("two.bag").status, 0);
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages / 2);
  std::ifstream table(path("run/statistics.csv"));
  const std::string text{std::istreambuf_iterator<char>(table), {}};
  EXPECT_NE(text.find("two cameras on one topic"), std::string::npos);
}

TEST_F(FieldBags, AMaskIsHeldToAndOneOfAnotherSizeIsNamed) {
  write("run.bag", [](int, Recorded*) {});
  cv::Mat mask(150, 200, CV_8UC1, cv::Scalar(255));
  mask.rowRange(90, 150).setTo(0);
  cv::imwrite(path("mask.png"), mask);
  EXPECT_EQ(track("run.bag", "--mask " + path("mask.png")).status, 0);
  EXPECT_EQ(summary()["frames_tracked"], kFieldImages);
  cv::imwrite(path("small.png"), mask.rowRange(0, 100));
  const ProgramOutcome outcome = track("run.bag", "--mask " + path("small.png"));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_SAYS(outcome, path("small.png") + ": the mask is 200 x 100");
}

TEST_F(FieldBags, AMapIsFollowedAndStaysAsItIs) {
  write("run.bag", [](int, Recorded*) {});
  ASSERT_EQ(track("run.bag").status, 0);
  std::filesystem::rename(path("run/final.map"), path("desk.map"));
  const auto contentOf = [](const std::string& name) {
    std::ifstream file(name, std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(file), {}};
  };
  const std::string before = contentOf(path("desk.map"));
  ASSERT_FALSE(before.empty());
  EXPECT_SAYS(track("run.bag", "--localise"), "--map");
  track("run.bag", "--localise --map " + path("desk.map"));
  EXPECT_EQ(contentOf(path("desk.map")), before);
  EXPECT_FALSE(std::filesystem::exists(path("run/final.map")));
  EXPECT_EQ(summary()["map"]["started"], 0);
}

TEST_F(FieldBags, TheErrorInAnUnknownUnitIsLeftOut) {
  write("run.bag", [](int, Recorded*) {});
  std::ofstream truth(path("truth.txt"));
  for (int i = 0; i < kFieldImages; ++i)
    truth << 1000.0 + i / 30.0 << " " << 0.03 * i << " 0 0 0 0 0 1\n";
  truth.close();
  const ProgramOutcome outcome = track("run.bag", "--ground-truth " + path("truth.txt"));
  EXPECT_SAYS(outcome, "ATE Sim(3)");
  EXPECT_FALSE(says(outcome, "ATE SE(3)")) << outcome.output;
}

}  // namespace
}  // namespace active_matching_slam
