#include "active_matching_slam/map/map_monitor.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace active_matching_slam {
namespace {

constexpr double kIntervalS = 1.0 / 30.0, kSharpness = 8.0;

/// `count` features from `first` on.
std::vector<FeatureId> features(FeatureId first, int count) {
  std::vector<FeatureId> ids(static_cast<std::size_t>(count));
  std::iota(ids.begin(), ids.end(), first);
  return ids;
}

struct Watch {
  MapMonitor monitor;
  double stamp_s = 1.0;

  /// Whether the map was found wrong within so many seconds of such images.
  bool isWrongWithin(double seconds, int matched, double sharpness) {
    for (const double end_s = stamp_s + seconds; stamp_s < end_s; stamp_s += kIntervalS) {
      monitor.add(stamp_s, features(0, 60), features(0, matched), sharpness);
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

/// A camera that moves on: twenty old features that match, and forty that are new in each image and
/// don't.
TEST(MapMonitor, WhatHasJustBeenStartedIsNotHeldAgainstTheMap) {
  Watch watch;
  watch.isWrongWithin(3.0, 50, kSharpness);
  FeatureId next = 1000;
  for (const double end_s = watch.stamp_s + 5.0; watch.stamp_s < end_s;
       watch.stamp_s += kIntervalS) {
    std::vector<FeatureId> predicted = features(0, 20);
    const std::vector<FeatureId> started = features(next, 40);
    next += 40;
    predicted.insert(predicted.end(), started.begin(), started.end());
    watch.monitor.add(watch.stamp_s, predicted, features(0, 20), kSharpness);
    ASSERT_FALSE(watch.monitor.isWrong());
  }
}

TEST(MapMonitor, WhatNeverMatchesIsHeldAgainstTheMapOnceItIsOld) {
  Watch watch;
  watch.isWrongWithin(3.0, 60, kSharpness);
  std::vector<FeatureId> predicted = features(0, 20);
  const std::vector<FeatureId> started = features(1000, 40);
  predicted.insert(predicted.end(), started.begin(), started.end());
  double judged_s = 0.0;
  for (; judged_s < 5.0 && !watch.monitor.isWrong(); judged_s += kIntervalS) {
    watch.stamp_s += kIntervalS;
    watch.monitor.add(watch.stamp_s, predicted, features(0, 20), kSharpness);
  }
  EXPECT_TRUE(watch.monitor.isWrong());
  EXPECT_GT(judged_s, 1.0) << "not while they are new";
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
