#include "active_matching_slam/simulation/scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "active_matching_slam/simulation/motions.h"
#include "active_matching_slam/simulation/renderer.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

using Eigen::Vector3d;

double distanceTo(const Surface& s, const Vector3d& point) {
  const Vector3d offset = point - s.origin;
  const Vector3d nearest = s.at(std::clamp(s.u_axis.dot(offset), 0.0, s.width_m),
                                std::clamp(s.v_axis.dot(offset), 0.0, s.height_m));
  return (point - nearest).norm();
}

/// Of every motion, a cameraman's distance to what stands there.
double leastClearance(const Scene& scene) {
  double least = std::numeric_limits<double>::max();
  for (const NamedChoice& choice : motionChoices())
    for (std::uint64_t seed : {1, 2, 3}) {
      const Motion motion = createMotion(choice.name, scene.stage, seed);
      for (double t = 0.0; t < 40.0; t += 0.25) {
        const Vector3d position = motion.at(t).T_world_camera.translation();
        for (const Surface& s : scene.surfaces) least = std::min(least, distanceTo(s, position));
      }
    }
  return least;
}

class EveryScene : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryScene, IsLitAndLeavesRoomToMove) {
  const Scene scene = createScene(GetParam(), 3);
  EXPECT_NO_THROW(checkScene(scene));
  for (const Surface& s : scene.surfaces) {
    double low = 0.0, high = 0.0;
    cv::minMaxLoc(s.albedo, &low, &high);
    EXPECT_GE(low, 0.0);
    EXPECT_LT(high, 8.0);  // what the renderer can store
  }
  EXPECT_GT(leastClearance(scene), 0.15);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene,
                         ::testing::Values("room", "office", "walkway", "desk", "checkerboard",
                                           "two_depths", "corridor", "corridor_end", "wall",
                                           "corridor_loop", "rooms", "planks"),
                         [](const auto& info) { return info.param; });

TEST(Scenes, EveryListedNameIsTested) { EXPECT_EQ(sceneChoices().size(), 12u); }

TEST(Scenes, AnUnknownNameIsRefusedWithTheList) {
  try {
    createScene("moon");
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "scene = 'moon' is not one of room, office, walkway, desk, checkerboard, "
                 "two_depths, corridor, corridor_end, corridor_loop, rooms, wall, planks");
  }
}

/// Seen in the rooms from a place in the first one, looking away from the doors, after a turn about
/// their middle.
cv::Mat viewOfRooms(const Renderer& renderer, double turn_rad) {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  const Vector3d ahead = Vector3d(1.0, 1.0, 0.0).normalized(), down = -Vector3d::UnitZ();
  T_world_camera.linear() << down.cross(ahead), down, ahead;
  T_world_camera.translation() = Vector3d(2.0, 2.0, 1.5);
  T_world_camera.prerotate(Eigen::AngleAxisd(turn_rad, Vector3d::UnitZ()));
  cv::Mat image;
  renderer.render(T_world_camera, image);
  return image;
}

TEST(Rooms, OppositeOnesLookTheSameAndNeighboursDoNot) {
  const CameraModel camera(makeSimulatedCalibration(160, 120, "none"));
  const Renderer renderer(camera, createScene("rooms", 5));
  const cv::Mat first = viewOfRooms(renderer, 0.0);
  const auto difference = [&](double turn_rad) {
    return cv::norm(first, viewOfRooms(renderer, turn_rad), cv::NORM_L1) /
           static_cast<double>(first.total());
  };
  EXPECT_LT(difference(M_PI), 1e-3);
  EXPECT_GT(difference(0.5 * M_PI), 0.03);
  EXPECT_GT(difference(1.5 * M_PI), 0.03);
}

Surface floorOf(double level) {
  Surface s;
  s.origin = Vector3d(-2, 2, 0);
  s.u_axis = Vector3d::UnitX();
  s.v_axis = -Vector3d::UnitY();
  s.width_m = s.height_m = 4.0;
  s.albedo = cv::Mat(64, 64, CV_32FC1, cv::Scalar(level));
  return s;
}

TEST(Light, FallsOffFromALampByTheInverseSquareAndBothCosines) {
  Scene scene;
  scene.surfaces = {floorOf(0.5)};
  scene.ambient = 0.0;
  scene.lights = {{Vector3d(0, 0, 2.0), -Vector3d::UnitZ(), 0.01, 3.0}};
  bakeLight(scene);
  const auto expected = [](double x, double y) {
    const double d2 = x * x + y * y + 4.0;
    return 0.5 * 3.0 * (4.0 / d2) / d2;
  };
  for (int column : {8, 32, 50}) {
    const double x = -2 + (column + 0.5) / 16, y = 2 - 20.5 / 16;
    EXPECT_NEAR(scene.surfaces[0].albedo.at<float>(20, column), expected(x, y), 0.004);
  }
}

TEST(Light, ShadowsFallWhereSomethingIsInBetween) {
  Scene scene;
  Surface shade = floorOf(0.5);
  shade.origin = Vector3d(-2, 2, 1.0);
  shade.width_m = 2.0;  // covers x < 0
  scene.surfaces = {floorOf(0.5), shade};
  scene.ambient = 0.0;
  scene.lights = {{Vector3d(0, 0, 2.0), -Vector3d::UnitZ(), 0.01, 3.0}};
  bakeLight(scene);
  EXPECT_LT(scene.surfaces[0].albedo.at<float>(32, 16), 1e-6);
  EXPECT_GT(scene.surfaces[0].albedo.at<float>(32, 48), 0.1);
}

}  // namespace
}  // namespace active_matching_slam
