#include "active_matching_slam/simulation/motions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Stage wideStage() {
  Stage stage;
  stage.T_world_start = Isometry3d(Eigen::AngleAxisd(1.9, Vector3d(1.0, -0.4, 0.3).normalized()));
  stage.T_world_start.translation() = Vector3d(1.0, 2.0, 3.0);
  stage.reach_min_m = Vector3d(-0.9, -0.35, -0.5);
  stage.reach_max_m = Vector3d(0.9, 0.35, 0.7);
  return stage;
}

class EveryMotion : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMotion, ReportsTheDerivativeOfItsPose) {
  const Motion motion = createMotion(GetParam(), wideStage(), 5);
  constexpr double kStep = 1e-5;
  for (double t : {0.05, 0.4, 0.99999, 1.0, 1.7, 4.2, 12.3, 29.0}) {
    const MotionSample before = motion.at(t - kStep), at = motion.at(t),
                       after = motion.at(t + kStep);
    const Vector3d velocity =
        (after.T_world_camera.translation() - before.T_world_camera.translation()) / (2 * kStep);
    EXPECT_LT((velocity - at.velocity_world).norm(), 1e-7) << "at " << t;
    const Eigen::AngleAxisd turn(before.T_world_camera.linear().transpose() *
                                 after.T_world_camera.linear());
    const Vector3d rate = turn.angle() * turn.axis() / (2 * kStep);
    EXPECT_LT((rate - at.angular_velocity_camera).norm(), 1e-6) << "at " << t;
  }
}

TEST_P(EveryMotion, StartsAtRestAtTheStart) {
  const Stage stage = wideStage();
  for (double t : {-1.0, 0.0}) {
    const MotionSample start = createMotion(GetParam(), stage, 3).at(t);
    EXPECT_TRUE(start.T_world_camera.isApprox(stage.T_world_start, 1e-12));
    EXPECT_EQ(start.velocity_world.norm(), 0.0);
    EXPECT_EQ(start.angular_velocity_camera.norm(), 0.0);
  }
}

TEST_P(EveryMotion, StaysWithinReach) {
  const Stage stage = wideStage();
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Motion motion = createMotion(GetParam(), stage, seed);
    for (double t = 0.0; t < 60.0; t += 0.05) {
      const Vector3d p = stage.T_world_start.inverse() * motion.at(t).T_world_camera.translation();
      ASSERT_TRUE((p.array() >= stage.reach_min_m.array() - 1e-12).all()) << p.transpose();
      ASSERT_TRUE((p.array() <= stage.reach_max_m.array() + 1e-12).all()) << p.transpose();
    }
  }
}

TEST_P(EveryMotion, IsTheSameForTheSameSeed) {
  const Motion one = createMotion(GetParam(), wideStage(), 7);
  const Motion two = createMotion(GetParam(), wideStage(), 7);
  for (double t : {0.3, 11.0})
    EXPECT_EQ(one.at(t).T_world_camera.matrix(), two.at(t).T_world_camera.matrix());
}

INSTANTIATE_TEST_SUITE_P(Motions, EveryMotion,
                         ::testing::Values("slow", "jerky", "sideways", "forward", "sweep",
                                           "circle", "still", "shake", "loop"),
                         [](const auto& info) { return info.param; });

TEST(Motions, EveryListedNameIsTested) { EXPECT_EQ(motionChoices().size(), 9u); }

TEST(Motions, ALoopGoesRoundItsMiddleLookingAlong) {
  Stage stage = wideStage();
  stage.loop_radius_m = 5.0;
  const Motion motion = createMotion("loop", stage, 2);
  double turned = 0.0;
  for (double t = 2.0; t < 40.0; t += 0.1) {
    const MotionSample sample = motion.at(t);
    const Vector3d p = stage.T_world_start.inverse() * sample.T_world_camera.translation();
    EXPECT_NEAR(std::hypot(p.x() - 5.0, p.z()), 5.0, 1e-9);
    const Vector3d ahead = sample.T_world_camera.linear().col(2);
    EXPECT_GT(ahead.dot(sample.velocity_world.normalized()), 0.9);
    turned += 0.1 * sample.angular_velocity_camera.y();
  }
  EXPECT_GT(turned, 2.0 * M_PI) << "more than once round";
}

TEST(Motions, SlowComesBackToTheStart) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Stage stage = wideStage();
    const Motion motion = createMotion("slow", stage, seed);
    double farthest = 0.0;
    for (double t = 0.0; t < 30.0; t += 0.1)
      farthest = std::max(
          farthest,
          (motion.at(t).T_world_camera.translation() - stage.T_world_start.translation()).norm());
    const double end =
        (motion.at(30.0).T_world_camera.translation() - stage.T_world_start.translation()).norm();
    EXPECT_GT(farthest, 0.5);
    EXPECT_LT(end, 0.1) << "seed " << seed;
  }
}

struct Peaks {
  double speed = 0.0, turn = 0.0;
};

Peaks peaksOf(const std::string& name, std::uint64_t seed) {
  const Motion motion = createMotion(name, wideStage(), seed);
  Peaks peaks;
  for (double t = 0.0; t < 30.0; t += 0.01) {
    const MotionSample sample = motion.at(t);
    peaks.speed = std::max(peaks.speed, sample.velocity_world.norm());
    peaks.turn = std::max(peaks.turn, sample.angular_velocity_camera.norm());
  }
  return peaks;
}

TEST(Motions, JerkyIsHastyAndSlowIsCalm) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Peaks jerky = peaksOf("jerky", seed), slow = peaksOf("slow", seed);
    EXPECT_GT(jerky.turn, 0.9);
    EXPECT_LT(jerky.turn, 2.0);
    EXPECT_GT(jerky.speed, 0.4);
    EXPECT_LT(jerky.speed, 1.3);
    EXPECT_LT(slow.turn, 0.7);
    EXPECT_LT(slow.speed, 0.5);
  }
}

TEST(Motions, SweepLooksToBothSidesOfItsWay) {
  const Stage stage = wideStage();
  const Motion motion = createMotion("sweep", stage, 3);
  double left = 0.0, right = 0.0;  // of where it looks
  for (double t = 0.0; t < 15.0; t += 0.1) {
    const double side =
        (stage.T_world_start.inverse() * motion.at(t).T_world_camera).linear()(0, 2);
    left = std::min(left, side);
    right = std::max(right, side);
  }
  EXPECT_LT(left, -std::sin(M_PI / 3.0));
  EXPECT_GT(right, std::sin(M_PI / 3.0));
}

TEST(Motions, StillDoesNotMove) {
  const Motion motion = createMotion("still", wideStage(), 2);
  EXPECT_EQ(motion.at(17.0).T_world_camera.matrix(), motion.at(0.0).T_world_camera.matrix());
}

TEST(Motions, AnUnknownNameIsRefusedWithTheList) {
  try {
    createMotion("sprint", wideStage());
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(
        error.what(),
        "motion = 'sprint' is not one of slow, jerky, sideways, forward, sweep, circle, loop, "
        "still, shake");
  }
}

}  // namespace
}  // namespace active_matching_slam
