#include "active_matching_slam/image/working_size.h"

#include <gtest/gtest.h>

#include <cmath>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/image_options.h"

namespace active_matching_slam {
namespace {

CameraCalibration calibrationOf(int width, int height) {
  CameraCalibration calibration;
  calibration.width = width;
  calibration.height = height;
  calibration.fx = 0.8 * width;
  calibration.fy = 0.81 * width;
  calibration.cx = 0.52 * width;
  calibration.cy = 0.47 * height;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {-0.25, 0.06, 0.001, -0.0005, 0.0};
  return calibration;
}

TEST(WorkingSize, KeepsImagesOfFewEnoughPixels) {
  for (const auto& [width, height] : {std::pair(320, 240), {800, 600}, {1226, 370}}) {
    const WorkingSize working(calibrationOf(width, height), 800);
    EXPECT_FALSE(working.isReduced());
    EXPECT_TRUE(sameImaging(working.calibration(), calibrationOf(width, height)));
    const cv::Mat image(height, width, CV_8UC1, cv::Scalar(7));
    EXPECT_EQ(working.reduce(image).data, image.data);
    EXPECT_EQ(working.scale(), 1.0);
  }
}

TEST(WorkingSize, ReducesLargerOnesToAsManyPixelsOfTheSameProportions) {
  for (const auto& [width, height] :
       {std::pair(1280, 720), {1920, 1080}, {3840, 2160}, {1021, 767}}) {
    const WorkingSize working(calibrationOf(width, height), 800);
    ASSERT_TRUE(working.isReduced());
    const CameraCalibration& reduced = working.calibration();
    EXPECT_NEAR(reduced.width * reduced.height, 800 * 600, 2000);
    EXPECT_NEAR(static_cast<double>(reduced.width) / reduced.height,
                static_cast<double>(width) / height, 5e-3);
    EXPECT_NEAR(working.scale() * width, reduced.width, 1.0);
    EXPECT_EQ(working.givenWidth(), width);
    EXPECT_EQ(working.givenHeight(), height);
    const cv::Mat image(height, width, CV_8UC1, cv::Scalar(7));
    EXPECT_EQ(working.reduce(image).size(), cv::Size(reduced.width, reduced.height));
  }
}

TEST(WorkingSize, ProjectsAPointToTheSamePlaceOfEitherImage) {
  const CameraCalibration given = calibrationOf(1930, 1090);
  const WorkingSize working(given, 800);
  const CameraModel full(given), reduced(working.calibration());
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.0, 0.0, 1.0), {0.4, -0.2, 1.0}, {-0.45, 0.22, 0.9}})
    EXPECT_LT((working.reduce(*full.project(point)) - *reduced.project(point)).norm(), 1e-9);
}

/// A bright spot around (u, v) of an image.
cv::Mat spotAt(const cv::Size& size, double u, double v, double sigma) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(std::lround(
          250.0 * std::exp(-0.5 * ((x - u) * (x - u) + (y - v) * (y - v)) / (sigma * sigma))));
  return image;
}

TEST(WorkingSize, ShowsWhatItShowsWhereItSaysItDoes) {
  for (const auto& [width, height] : {std::pair(1600, 1200), {1920, 1080}, {2700, 1800}}) {
    const WorkingSize working(calibrationOf(width, height), 800);
    const Eigen::Vector2d place(0.31 * width + 0.3, 0.62 * height - 0.2);
    const cv::Mat reduced = working.reduce(spotAt({width, height}, place.x(), place.y(), 12.0));
    double sum = 0.0, sum_u = 0.0, sum_v = 0.0;
    for (int v = 0; v < reduced.rows; ++v)
      for (int u = 0; u < reduced.cols; ++u) {
        const double grey = reduced.at<std::uint8_t>(v, u);
        sum += grey;
        sum_u += grey * u;
        sum_v += grey * v;
      }
    const Eigen::Vector2d expected = working.reduce(place);
    EXPECT_NEAR(sum_u / sum, expected.x(), 0.01) << width;
    EXPECT_NEAR(sum_v / sum, expected.y(), 0.01) << width;
  }
}

TEST(WorkingSize, IsRefusedOutOfRangeByName) {
  ImageOptions options;
  options.working_width = 100;
  try {
    checkImageOptions(options);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("working_width = 100"), std::string::npos);
  }
}

}  // namespace
}  // namespace active_matching_slam
