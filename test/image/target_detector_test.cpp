#include "active_matching_slam/image/target_detector.h"

#include <gtest/gtest.h>

#include "image/flat_target.h"
#include "image/textures.h"

namespace active_matching_slam {
namespace {

CameraModel targetCamera() {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = calibration.fy = 500.0;
  calibration.cx = 320.0;
  calibration.cy = 240.0;
  return CameraModel(calibration);
}

Eigen::Isometry3d aslant() {
  Eigen::Isometry3d T_camera_sheet = Eigen::Isometry3d::Identity();
  T_camera_sheet.translation() = Eigen::Vector3d(0.05, -0.03, 1.2);
  T_camera_sheet.linear() =
      Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 1).normalized()).toRotationMatrix();
  return T_camera_sheet;
}

cv::Mat seen(const PrintedTarget& target) {
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(120));
  paste(target, targetCamera(), aslant(), &image);
  return image;
}

/// Largest distance of a sighted corner from where it is, whichever way round it was named.
double error(const TargetSighting& sighting, const TargetDescription& target) {
  Eigen::Vector2d size(target.size_m, target.size_m);
  if (target.kind == TargetDescription::Kind::kChessboard)
    size = target.square_m * Eigen::Vector2d(target.columns - 1, target.rows - 1);
  double worst = 0.0;
  for (const Eigen::Vector2d& pixel : sighting.pixels) {
    double nearest = 1e9;
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5}) {
        const Eigen::Vector3d corner(x * size.x(), y * size.y(), 0.0);
        nearest = std::min(nearest, (*targetCamera().project(aslant() * corner) - pixel).norm());
      }
    worst = std::max(worst, nearest);
  }
  return worst;
}

TEST(TargetDetector, FindsTheCornersOfATagToAFractionOfAPixel) {
  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  const TargetSighting sighting = TargetDetector(exampleTag()).detect(seen(printTag(exampleTag())));
  ASSERT_EQ(sighting.pixels.size(), 4u);
  ASSERT_EQ(sighting.positions_m.size(), 4u);
  EXPECT_LT(error(sighting, exampleTag()), 0.3);
  EXPECT_NEAR((sighting.positions_m[0] - sighting.positions_m[1]).norm(), 0.25, 1e-12);
  EXPECT_NEAR((sighting.positions_m[0] - sighting.positions_m[2]).norm(), std::hypot(0.25, 0.25),
              1e-12);
}

TEST(TargetDetector, FindsTheOuterCornersOfAChessboard) {
  const TargetSighting sighting =
      TargetDetector(exampleChessboard()).detect(seen(printChessboard(exampleChessboard())));
  ASSERT_EQ(sighting.pixels.size(), 4u);
  EXPECT_LT(error(sighting, exampleChessboard()), 0.3);
  EXPECT_NEAR((sighting.positions_m[0] - sighting.positions_m[1]).norm(), 0.25, 1e-12);
  EXPECT_NEAR((sighting.positions_m[1] - sighting.positions_m[2]).norm(), 0.15, 1e-12);
}

TEST(TargetDetector, AnotherTagIsNotTakenForIt) {
  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  TargetDescription other = exampleTag();
  other.id = 8;
  EXPECT_TRUE(TargetDetector(exampleTag()).detect(seen(printTag(other))).pixels.empty());
  other = exampleTag();
  other.dictionary = "DICT_6X6_50";
  EXPECT_TRUE(TargetDetector(exampleTag()).detect(seen(printTag(other))).pixels.empty());
  EXPECT_TRUE(TargetDetector(exampleTag()).detect(randomImage(640, 480, 1)).pixels.empty());
}

TEST(TargetDetector, ADescriptionThatIsNoneIsNamed) {
  const auto message = [](const TargetDescription& target) {
    try {
      checkTarget(target);
    } catch (const std::invalid_argument& fault) {
      return std::string(fault.what());
    }
    return std::string();
  };
  TargetDescription board = exampleChessboard();
  board.square_m = 0.0;
  EXPECT_NE(message(board).find("square_m"), std::string::npos);
  board = exampleChessboard();
  board.rows = 1;
  EXPECT_NE(message(board).find("rows = 1"), std::string::npos);
  TargetDescription tag = exampleTag();
  tag.dictionary = "tag99h1";
  EXPECT_FALSE(message(tag).empty());
  if (tagDictionaries().empty()) return;
  EXPECT_NE(message(tag).find("tag36h11"), std::string::npos);
  tag = exampleTag();
  tag.id = 587;
  EXPECT_NE(message(tag).find("id = 587"), std::string::npos);
  tag = exampleTag();
  tag.size_m = -1.0;
  EXPECT_NE(message(tag).find("size_m"), std::string::npos);
}

}  // namespace
}  // namespace active_matching_slam
