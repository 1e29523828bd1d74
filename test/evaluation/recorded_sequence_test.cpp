#include "active_matching_slam/evaluation/recorded_sequence.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace active_matching_slam {
namespace {

/// Three images of one grey each: 10, 20, 30.
class RecordedSequenceTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = "/tmp/ams_sequence_" + std::to_string(getpid());
    std::filesystem::create_directories(folder_ + "/frames");
    std::ofstream(folder_ + "/camera.yaml")
        << "image_width: 64\nimage_height: 48\ncamera_name: x\ndistortion_model: plumb_bob\n"
        << "camera_matrix: {rows: 3, cols: 3, data: [50, 0, 32, 0, 50, 24, 0, 0, 1]}\n"
        << "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
    std::ofstream times(folder_ + "/times.txt");
    times << "# seconds file\n";
    for (int i = 1; i <= 3; ++i) {
      const std::string file = "frames/" + std::to_string(i) + ".png";
      cv::imwrite(folder_ + "/" + file, cv::Mat(48, 64, CV_8UC1, cv::Scalar(10 * i)));
      times << 0.5 * i << " " << file << "\n";
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::vector<std::pair<int, double>> framesOf(int every) const {
    std::vector<std::pair<int, double>> frames;
    RecordedSequence(folder_, every).forEachFrame([&](const cv::Mat& image, double stamp_s) {
      frames.emplace_back(image.at<unsigned char>(0, 0), stamp_s);
      return true;
    });
    return frames;
  }

  std::string folder_;
};

using Frames = std::vector<std::pair<int, double>>;

TEST_F(RecordedSequenceTest, DeliversImagesWithTheirStamps) {
  EXPECT_EQ(framesOf(1), (Frames{{10, 0.5}, {20, 1.0}, {30, 1.5}}));
  EXPECT_EQ(framesOf(2), (Frames{{10, 0.5}, {30, 1.5}}));
  EXPECT_EQ(RecordedSequence(folder_).camera().width(), 64);
}

TEST_F(RecordedSequenceTest, StopsWhenAskedTo) {
  int frames = 0;
  RecordedSequence(folder_).forEachFrame([&](const cv::Mat&, double) { return ++frames < 2; });
  EXPECT_EQ(frames, 2);
}

TEST_F(RecordedSequenceTest, NamesWhatItCanNotRead) {
  std::filesystem::remove(folder_ + "/frames/2.png");
  try {
    framesOf(1);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("frames/2.png"), std::string::npos);
  }
  EXPECT_THROW(RecordedSequence(folder_, 0), std::invalid_argument);
  std::ofstream(folder_ + "/times.txt") << "rubbish\n";
  EXPECT_THROW(RecordedSequence{folder_}, std::runtime_error);
}

}  // namespace
}  // namespace active_matching_slam
