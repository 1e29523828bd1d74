#include "active_matching_slam/evaluation/run_sequence.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace active_matching_slam {
namespace {

/// Ten images of noise, a tenth of a second apart.
class TenImages : public ImageSource {
 public:
  bool next(cv::Mat* image, double* stamp_s) override {
    if (next_ == 10) return false;
    image->create(120, 160, CV_8UC1);
    cv::RNG random(17);
    random.fill(*image, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(*image, *image, {5, 5}, 1.5);
    *stamp_s = 0.1 * next_++;
    return true;
  }
  bool skip() override { return next_ < 10 && ++next_ <= 10; }

 private:
  int next_ = 0;
};

class RunSequence : public testing::Test {
 protected:
  std::vector<double> stampsOf(const RunOptions& options) {
    CameraCalibration calibration;
    calibration.width = 160;
    calibration.height = 120;
    calibration.fx = calibration.fy = 120.0;
    calibration.cx = 80.0;
    calibration.cy = 60.0;
    TrackerOptions tracker_options;
    tracker_options.matcher = "active_search";
    Tracker tracker{CameraModel(calibration), tracker_options};
    TenImages source;
    std::vector<double> stamps;
    const int frames = runSequence(&source, &tracker, options, [&](const TrackedFrame& frame) {
      stamps.push_back(frame.stamp_s);
    });
    EXPECT_EQ(frames, static_cast<int>(stamps.size()));
    return stamps;
  }
};

TEST_F(RunSequence, TracksEveryImage) { EXPECT_EQ(stampsOf({}).size(), 10u); }

TEST_F(RunSequence, TakesTheFirstOfEveryThree) {
  const std::vector<double> stamps = stampsOf({3, 0});
  ASSERT_EQ(stamps.size(), 4u);
  EXPECT_NEAR(stamps[1], 0.3, 1e-12);
  EXPECT_NEAR(stamps[3], 0.9, 1e-12);
}

TEST_F(RunSequence, StopsAfterTheNumberOfFramesAskedFor) {
  EXPECT_EQ(stampsOf({1, 4}).size(), 4u);
  EXPECT_EQ(stampsOf({2, 2}).size(), 2u);
  EXPECT_EQ(stampsOf({1, 99}).size(), 10u);
}

TEST_F(RunSequence, RefusesOptionsOutOfRange) {
  EXPECT_THROW(stampsOf({0, 0}), std::invalid_argument);
  EXPECT_THROW(stampsOf({1, -1}), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
