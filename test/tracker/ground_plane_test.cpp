#include "active_matching_slam/tracker/ground_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "active_matching_slam/simulation/simulator.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

constexpr double kHeight = 1.2;

GroundOptions someHeight() {
  GroundOptions options;
  options.camera_height_m = kHeight;
  return options;
}

/// What a camera over a street sees: points of the street, and of fronts to both sides. The street
/// is turned about the camera's axes by `pitch_rad` and `roll_rad`.
std::vector<PointBelow> street(int on_ground, int elsewhere, double pitch_rad, double roll_rad,
                               std::uint32_t seed) {
  constexpr double kDepthError = 0.03;
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  const Eigen::Matrix3d R_camera_level = (Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()) *
                                          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitX()))
                                             .toRotationMatrix();
  std::vector<PointBelow> points;
  for (int i = 0; i < on_ground + elsewhere; ++i) {
    const double ahead = 4.0 + 12.0 * uniform(engine), side = 8.0 * uniform(engine) - 4.0;
    const double rise = 2.5 * uniform(engine);
    const double unevenness = someHeight().unevenness * kHeight * normal(engine);
    const Eigen::Vector3d level =
        i < on_ground ? Eigen::Vector3d(side, kHeight + unevenness, ahead)
                      : Eigen::Vector3d(side < 0.0 ? -5.0 : 5.0, kHeight - 0.2 - rise, ahead);
    const Eigen::Vector3d ray = R_camera_level * level;
    PointBelow point;
    point.position_camera = ray * (1.0 + kDepthError * normal(engine));
    point.covariance = kDepthError * kDepthError * ray * ray.transpose();
    points.push_back(point);
  }
  return points;
}

TEST(GroundPlane, AThirdOfThePointsIsEnough) {
  const auto ground =
      findGround(street(30, 60, 0.01, -0.008, 1), Eigen::Vector3d::UnitY(), someHeight());
  ASSERT_TRUE(ground);
  EXPECT_NEAR(ground->height, kHeight, 4.0 * kHeight * ground->relative_sigma);
  EXPECT_LT(ground->relative_sigma, 0.05);
  EXPECT_GE(ground->points, 20);
}

TEST(GroundPlane, AccuracyIsAsStated) {
  constexpr int kTrials = 200;
  double squares = 0.0;
  int found = 0;
  std::mt19937 engine(7);
  std::normal_distribution<double> tilt(0.0, someHeight().tilt_sigma_deg * M_PI / 180.0);
  for (int trial = 0; trial < kTrials; ++trial) {
    const double pitch = tilt(engine), roll = tilt(engine);
    const auto ground = findGround(street(40, 40, pitch, roll, 100 + trial),
                                   Eigen::Vector3d::UnitY(), someHeight());
    if (!ground) continue;
    ++found;
    squares += std::pow(std::log(ground->height / kHeight) / ground->relative_sigma, 2);
  }
  // Within a factor of two of the variance: which points are on the ground is no Gaussian matter.
  EXPECT_GT(found, 0.9 * kTrials);
  EXPECT_GT(squares / found, 0.5);
  EXPECT_LT(squares / found, 2.0);
}

TEST(GroundPlane, ACameraThatLooksDownIsToldSo) {
  const double pitch_rad = 0.35;
  GroundOptions options = someHeight();
  options.camera_pitch_deg = pitch_rad * 180.0 / M_PI;
  const auto ground = findGround(street(40, 40, pitch_rad, 0.0, 3), options.downCamera(), options);
  ASSERT_TRUE(ground);
  EXPECT_NEAR(ground->height, kHeight, 4.0 * kHeight * ground->relative_sigma);
}

TEST(GroundPlane, WhereNoneIsSeenNoneIsFound) {
  const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  EXPECT_FALSE(findGround({}, down, someHeight()));
  EXPECT_FALSE(findGround(street(5, 0, 0.0, 0.0, 4), down, someHeight()));
  EXPECT_FALSE(findGround(street(0, 60, 0.0, 0.0, 5), down, someHeight()));
}

TEST(GroundPlane, WhatIsLevelAndHasPointsBelowIsNone) {
  // Twice as many points half way down, on something that stands there.
  std::vector<PointBelow> points = street(25, 0, 0.0, 0.0, 6);
  for (PointBelow point : street(50, 0, 0.0, 0.0, 7)) {
    point.position_camera.y() -= 0.5 * kHeight;
    points.push_back(point);
  }
  const auto ground = findGround(points, Eigen::Vector3d::UnitY(), someHeight());
  EXPECT_TRUE(!ground || std::abs(ground->height - kHeight) < 0.1 * kHeight);
}

TEST(GroundPlane, TheHeightOfACameraOverAFloorMakesTheMapMetric) {
  SimulatorOptions simulated = filmOptions(10.0);
  simulated.scene = "corridor";
  simulated.motion = "forward";
  const Film film = makeFilm(simulated);
  TrackerOptions options;
  const Eigen::Isometry3d& T_world_start = film.frames.front().truth.T_world_camera;
  options.ground.camera_height_m = T_world_start.translation().z();
  options.ground.camera_pitch_deg = std::asin(-T_world_start.linear()(2, 2)) * 180.0 / M_PI;
  Tracker tracker(film.camera, options);
  const Frames frames = trackFrames(film, &tracker, 0, static_cast<int>(film.frames.size()));
  int first = 0;
  while (first < static_cast<int>(frames.size()) &&
         frames[first]->scale_source != ScaleSource::kCameraHeight)
    ++first;
  ASSERT_LT(first, static_cast<int>(frames.size()) - 60);
  EXPECT_EQ(scaleSourceName(frames.back()->scale_source), "camera_height");
  const PathFit fit = fitPath(film, {frames.begin() + first, frames.end()}, first);
  EXPECT_NEAR(fit.scale, 1.0, 0.05);
  EXPECT_GT(frames.back()->scale_sigma, 0.0);
  int rescaled = 0;
  for (const auto& frame : frames) rescaled += frame->rescaled_by != 1.0;
  EXPECT_EQ(rescaled, 1);
}

}  // namespace
}  // namespace active_matching_slam
