#include "active_matching_slam/tracker/scale_finder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace active_matching_slam {
namespace {

UncertainVector uncertain(const Eigen::Vector3d& mean, double sigma) {
  return {mean, sigma * sigma * Eigen::Matrix3d::Identity()};
}

TEST(ScaleFinder, WaitsUntilTheWayIsLongerThanItsErrors) {
  ScaleFinder finder;
  const Eigen::Vector3d step(0.02, 0.0, 0.1);
  int steps = 0;
  while (!finder.scale() && steps < 1000) {
    finder.add(uncertain(2.5 * step, 0.01), uncertain(step, 0.03));
    ++steps;
  }
  ASSERT_TRUE(finder.scale());
  EXPECT_GT(steps, 5);
  EXPECT_NEAR(finder.scale()->map_units_per_m, 2.5, 0.05);
  const double before = finder.scale()->relative_sigma;
  for (int i = 0; i < 15 * steps; ++i)
    finder.add(uncertain(2.5 * step, 0.01), uncertain(step, 0.03));
  EXPECT_NEAR(finder.scale()->relative_sigma, 0.25 * before, 0.03 * before)
      << "sixteen times the way";
}

TEST(ScaleFinder, ACameraThatGoesToAndFroIsMeasuredByItsWholeWay) {
  ScaleFinder finder;
  for (int i = 0; i < 400; ++i) {
    const double side = i / 10 % 2 == 0 ? 1.0 : -1.0;
    finder.add(uncertain({side * 0.05, 0.0, 0.0}, 0.001),
               uncertain({side * 0.02, 0.0, 0.0}, 0.005));
  }
  ASSERT_TRUE(finder.scale());
  EXPECT_NEAR(finder.scale()->map_units_per_m, 2.5, 0.05);
  EXPECT_FALSE(finder.isContradicted());
}

TEST(ScaleFinder, TellsNothingWhereTheCameraGoesAnotherWayThanTheOdometry) {
  ScaleFinder finder;
  for (int i = 0; i < 20; ++i)
    finder.add(uncertain({0.1, 0.0, 0.0}, 0.001), uncertain({0.0, 0.1, 0.02}, 0.001));
  EXPECT_TRUE(finder.isContradicted());
  EXPECT_FALSE(finder.scale());
  finder.reset();
  EXPECT_FALSE(finder.isContradicted());
}

TEST(ScaleFinder, ARobotThatStandsHasNoScale) {
  ScaleFinder finder;
  for (int i = 0; i < 100; ++i)
    finder.add(uncertain(Eigen::Vector3d::Zero(), 0.001),
               uncertain(Eigen::Vector3d::Zero(), 0.001));
  EXPECT_FALSE(finder.scale());
  EXPECT_FALSE(finder.isContradicted());
}

TEST(ScaleFinder, AWayOfCentimetresToAndFroAmongErrorsAsLargeAddsUp) {
  // Far shorter between its ends than the odometry's errors over all of it.
  std::mt19937 engine(1);
  std::normal_distribution<double> normal(0.0, 0.01);
  ScaleFinder finder;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d step(i / 15 % 2 == 0 ? 0.002 : -0.002, 0.0, 0.0);
    const double x = normal(engine), y = normal(engine), z = normal(engine);
    finder.add(uncertain(0.5 * step, 1e-4), uncertain(step + Eigen::Vector3d(x, y, z), 0.01));
  }
  ASSERT_TRUE(finder.scale());
  EXPECT_NEAR(finder.scale()->map_units_per_m, 0.5, 3.0 * 0.5 * finder.scale()->relative_sigma);
}

TEST(ScaleFinder, ALongHaltIsNoHindranceAfterwards) {
  ScaleFinder finder;
  for (int i = 0; i < 3000; ++i)
    finder.add(uncertain(Eigen::Vector3d::Zero(), 0.001),
               uncertain(Eigen::Vector3d::Zero(), 0.005));
  const Eigen::Vector3d step(0.01, 0.0, 0.0);
  int steps = 0;
  while (!finder.scale() && steps < 100) {
    finder.add(uncertain(2.5 * step, 0.001), uncertain(step, 0.005));
    ++steps;
  }
  ASSERT_TRUE(finder.scale());
  EXPECT_NEAR(finder.scale()->map_units_per_m, 2.5, 0.05);
}

TEST(ScaleFinder, AccuracyIsAsStated) {
  std::mt19937 engine(2);
  std::normal_distribution<double> normal(0.0, 0.003);
  double squares = 0.0;
  constexpr int kTrials = 200;
  for (int trial = 0; trial < kTrials; ++trial) {
    ScaleFinder finder;
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3d step(0.003, i / 40 % 2 == 0 ? 0.004 : -0.004, 0.0);
      const double x = normal(engine), y = normal(engine), z = normal(engine);
      finder.add(uncertain(step, 1e-4), uncertain(step + Eigen::Vector3d(x, y, z), 0.003));
    }
    ASSERT_TRUE(finder.scale());
    const double error = std::log(finder.scale()->map_units_per_m);
    squares += std::pow(error / finder.scale()->relative_sigma, 2);
  }
  // Bounds of a chi-square of so many degrees that one in a thousand is outside of.
  EXPECT_NEAR(squares / kTrials, 1.0, 3.3 * std::sqrt(2.0 / kTrials));
}

}  // namespace
}  // namespace active_matching_slam
