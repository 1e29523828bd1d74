// Runs the executable (its path is compiled in as IMAGES_TO_BAG) on a few pictures of its own.

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sys/wait.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kImages = 12;

template <class Message>
std::vector<typename Message::ConstPtr> messagesOf(const std::string& bag_path,
                                                   const std::string& topic) {
  rosbag::Bag bag(bag_path);
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  std::vector<typename Message::ConstPtr> messages;
  for (const rosbag::MessageInstance& message : view)
    messages.push_back(message.instantiate<Message>());
  return messages;
}

/// Pictures frame0.png to frame11.png: evenly grey, ten levels brighter from one to the next.
class ImagesToBag : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = "/tmp/ams_images_to_bag_" + std::to_string(getpid());
    fs::create_directories(path("frames"));
    for (int i = 0; i < kImages; ++i)
      cv::imwrite(path("frames/frame" + std::to_string(i) + ".png"),
                  cv::Mat(48, 64, CV_8UC1, cv::Scalar(10 * i)));
    write("camera.yaml",
          "image_width: 64\nimage_height: 48\ncamera_name: small\n"
          "camera_matrix: {rows: 3, cols: 3, data: [60, 0, 31, 0, 61, 24, 0, 0, 1]}\n"
          "distortion_model: plumb_bob\n"
          "distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.02, 0, 0, 0]}\n");
    std::string times = "# seconds file\n";
    for (int i = 0; i < kImages; ++i)
      times += "1700000000.10" + std::to_string(1000000 + i) + " frames/frame" + std::to_string(i) +
               ".png\n";
    write("times.txt", times);
  }
  void TearDown() override { fs::remove_all(directory_); }

  std::string path(const std::string& name) const { return directory_ + "/" + name; }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
  }

  /// Exit status; `arguments` come after --images, the calibration and --output out.bag.
  int convert(const std::string& images, const std::string& arguments) const {
    const std::string command = std::string(IMAGES_TO_BAG) + " --images " + path(images) +
                                " --camera-info " + path("camera.yaml") + " --output " +
                                path("out.bag") + " " + arguments + " >/dev/null 2>" +
                                path("stderr.txt");
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  void expectFault(const std::string& what) const {
    std::ifstream file(path("stderr.txt"));
    std::string line, more;
    std::getline(file, line);
    EXPECT_NE(line.find(what), std::string::npos) << line;
    EXPECT_FALSE(std::getline(file, more)) << more;
    EXPECT_FALSE(fs::exists(path("out.bag")));
    EXPECT_FALSE(fs::exists(path("out.bag.part")));
  }

  std::string directory_;
};

TEST_F(ImagesToBag, KeepsStampsToTheNanosecondAndTheOrderOfTheTimesFile) {
  ASSERT_EQ(convert("frames", "--times " + path("times.txt")), 0);
  const auto images = messagesOf<sensor_msgs::Image>(path("out.bag"), "/camera/image_raw");
  ASSERT_EQ(images.size(), std::size_t{kImages});
  for (int i = 0; i < kImages; ++i) {
    EXPECT_EQ(images[i]->header.stamp, ros::Time(1700000000, 101000000 + i));
    EXPECT_EQ(images[i]->encoding, "mono8");
    EXPECT_EQ(images[i]->data.at(0), 10 * i);
  }
}

TEST_F(ImagesToBag, SaysTheCalibrationWithEveryImage) {
  ASSERT_EQ(convert("frames", "--rate 10"), 0);
  const auto infos = messagesOf<sensor_msgs::CameraInfo>(path("out.bag"), "/camera/camera_info");
  ASSERT_EQ(infos.size(), std::size_t{kImages});
  const sensor_msgs::CameraInfo& info = *infos.back();
  EXPECT_EQ(info.header.stamp, ros::Time(1.1));
  EXPECT_EQ(info.header.frame_id, "camera_optical_frame");
  EXPECT_EQ(info.width, 64u);
  EXPECT_EQ(info.height, 48u);
  EXPECT_EQ(info.distortion_model, "plumb_bob");
  EXPECT_EQ(info.D, (std::vector<double>{-0.1, 0.02, 0.0, 0.0, 0.0}));
  EXPECT_EQ(info.K[4], 61.0);
  EXPECT_EQ(info.P[2], 31.0);
}

TEST_F(ImagesToBag, CountsTheFramesOfAFolderAsPeopleDo) {
  ASSERT_EQ(convert("frames", "--rate 10"), 0);
  const auto images = messagesOf<sensor_msgs::Image>(path("out.bag"), "/camera/image_raw");
  ASSERT_EQ(images.size(), std::size_t{kImages});
  EXPECT_TRUE(images[0]->header.stamp.isZero());
  for (int i = 0; i < kImages; ++i) EXPECT_EQ(images[i]->data.at(0), 10 * i);
}

TEST_F(ImagesToBag, WritesTheTruthAsTransformAndAsPose) {
  write("truth.txt", "# t x y z qx qy qz qw\n0 1 2 3 0 0 0 1\n0.5 4 5 6 0 0.6 0 0.8\n");
  ASSERT_EQ(convert("frames", "--rate 10 --ground-truth " + path("truth.txt")), 0);
  const auto poses = messagesOf<geometry_msgs::PoseStamped>(path("out.bag"), "/ground_truth/pose");
  const auto transforms = messagesOf<tf2_msgs::TFMessage>(path("out.bag"), "/tf");
  ASSERT_EQ(poses.size(), 2u);
  ASSERT_EQ(transforms.size(), 2u);
  EXPECT_EQ(poses[1]->header.stamp, ros::Time(0.5));
  EXPECT_EQ(poses[1]->pose.position.y, 5.0);
  EXPECT_NEAR(poses[1]->pose.orientation.y, 0.6, 1e-12);
  const geometry_msgs::TransformStamped& transform = transforms[1]->transforms.at(0);
  EXPECT_EQ(transform.header.frame_id, "world");
  EXPECT_EQ(transform.child_frame_id, "camera_ground_truth");
  EXPECT_EQ(transform.transform.translation.z, 6.0);
  EXPECT_NEAR(transform.transform.rotation.w, 0.8, 1e-12);
}

TEST_F(ImagesToBag, ReadsAVideoFrameByFrame) {
  cv::VideoWriter video(path("video.avi"), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0,
                        cv::Size(64, 48));
  ASSERT_TRUE(video.isOpened());
  for (int i = 0; i < kImages; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(10 * i)));
  video.release();
  ASSERT_EQ(convert("video.avi", "--times " + path("times.txt")), 0);
  const auto images = messagesOf<sensor_msgs::Image>(path("out.bag"), "/camera/image_raw");
  ASSERT_EQ(images.size(), std::size_t{kImages});
  EXPECT_EQ(images[3]->encoding, "bgr8");
  EXPECT_NEAR(images[3]->data.at(0), 30, 3);
}

TEST_F(ImagesToBag, CompressesWhenAskedTo) {
  ASSERT_EQ(convert("frames", "--rate 10 --compressed"), 0);
  const auto images =
      messagesOf<sensor_msgs::CompressedImage>(path("out.bag"), "/camera/image_raw/compressed");
  ASSERT_EQ(images.size(), std::size_t{kImages});
  const cv::Mat image = cv::imdecode(images[5]->data, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(image.type(), CV_8UC1);
  EXPECT_NEAR(image.at<std::uint8_t>(20, 30), 50, 2);
}

TEST_F(ImagesToBag, NamesTheImageOfAnotherSizeThanTheCalibration) {
  cv::imwrite(path("frames/frame7.png"), cv::Mat(40, 64, CV_8UC1, cv::Scalar(0)));
  EXPECT_EQ(convert("frames", "--rate 10"), 2);
  expectFault("frame7.png: is 64x40");
}

TEST_F(ImagesToBag, RefusesTimesThatDoNotFitTheImages) {
  write("times.txt", "0.0\n0.1\n");
  EXPECT_EQ(convert("frames", "--times " + path("times.txt")), 2);
  expectFault("has 2 times, but there are more images");
}

TEST_F(ImagesToBag, RefusesTimeThatRunsBack) {
  write("times.txt", "0.1 frame0.png\n0.0 frame1.png\n");
  EXPECT_EQ(convert("frames", "--times " + path("times.txt")), 2);
  expectFault("times.txt line 2: time runs back");
}

TEST_F(ImagesToBag, NamesTheImageThatIsMissing) {
  write("times.txt", "0.0 frames/frame0.png\n0.1 frames/nothing.png\n");
  EXPECT_EQ(convert("frames", "--times " + path("times.txt")), 2);
  expectFault("nothing.png: no such image");
}

TEST_F(ImagesToBag, RefusesATruthThatIsNotOne) {
  write("truth.txt", "0 1 2 3 0 0 0 0.5\n");
  EXPECT_EQ(convert("frames", "--rate 10 --ground-truth " + path("truth.txt")), 2);
  expectFault("truth.txt line 1: the quaternion");
}

TEST_F(ImagesToBag, WantsEitherTimesOrARate) {
  EXPECT_EQ(convert("frames", ""), 2);
  expectFault("either --times or --rate");
}

}  // namespace
}  // namespace active_matching_slam
