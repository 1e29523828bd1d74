#include "active_matching_slam/map/map_monitor.h"

#include <gtest/gtest.h>

namespace active_matching_slam {
namespace {

constexpr double kIntervalS = 1.0 / 30.0, kSharpness = 8.0;

struct Watch {
  MapMonitor monitor;
  double stamp_s = 1.0;

  /// Whether the map was found wrong within so many seconds of such images.
  bool isWrongWithin(double seconds, int matched, double sharpness) {
    for (const double end_s = stamp_s + seconds; stamp_s < end_s; stamp_s += kIntervalS) {
      monitor.add(stamp_s, 60, matched, sharpness);
      if (monitor.isWrong()) return true;
    }
    return false;
  }
};

TEST(MapMonitor, AMapThatMatchesIsRight) {
  Watch watch;
  EXPECT_FALSE(watch.isWrongWithin(60.0, 40, kSharpness));
}

TEST(MapMonitor, AMapOfWhichMostDoesNotMatchInSharpImagesIsWrongWithinASecond) {
  Watch watch;
  watch.isWrongWithin(3.0, 50, kSharpness);
  EXPECT_TRUE(watch.isWrongWithin(1.0, 20, kSharpness));
}

TEST(MapMonitor, BlurAndDarkSayNothingOfTheMap) {
  Watch watch;
  watch.isWrongWithin(3.0, 50, kSharpness);
  EXPECT_FALSE(watch.isWrongWithin(10.0, 20, 0.3 * kSharpness));
}

TEST(MapMonitor, AHandThatCrossesTheViewIsNotHeldAgainstTheMap) {
  Watch watch;
  watch.isWrongWithin(3.0, 50, kSharpness);
  EXPECT_FALSE(watch.isWrongWithin(0.5, 20, kSharpness));
  EXPECT_FALSE(watch.isWrongWithin(0.1, 45, kSharpness));
  EXPECT_FALSE(watch.isWrongWithin(0.5, 20, kSharpness));
}

TEST(MapMonitor, AMapThatHasBeenRightIsToldFromOneThatNeverWas) {
  Watch proven, never;
  proven.isWrongWithin(3.0, 50, kSharpness);
  never.isWrongWithin(0.2, 50, kSharpness);
  ASSERT_TRUE(proven.isWrongWithin(1.0, 20, kSharpness));
  ASSERT_TRUE(never.isWrongWithin(1.0, 20, kSharpness));
  EXPECT_TRUE(proven.monitor.hasBeenRight());
  EXPECT_FALSE(never.monitor.hasBeenRight());
  proven.monitor.interrupt();
  EXPECT_FALSE(proven.monitor.isWrong());
  EXPECT_TRUE(proven.monitor.hasBeenRight()) << "lost and found again, it is the same map";
}

}  // namespace
}  // namespace active_matching_slam
