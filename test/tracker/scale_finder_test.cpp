#include "active_matching_slam/tracker/scale_finder.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace active_matching_slam
