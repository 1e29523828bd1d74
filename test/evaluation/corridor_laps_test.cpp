#include "active_matching_slam/evaluation/corridor_laps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

/// Mean of some numbers.
double meanOf(const std::vector<double>& values) {
  double sum = 0.0;
  for (double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// A lap and the beginning of the next: the loop closes.
CorridorOptions overTheLoop(MapBound bound) {
  CorridorOptions options;
  options.laps = 1.25;
  options.bound = bound;
  return options;
}

TEST(CorridorLaps, SubmapsCloseTheLoopThatDeletingLeavesOpen) {
  const CorridorResult submaps = runCorridorLaps(overTheLoop(MapBound::kSubmaps), 1);
  const CorridorResult deleted = runCorridorLaps(overTheLoop(MapBound::kDelete), 1);
  EXPECT_TRUE(submaps.healthy);
  ASSERT_EQ(submaps.laps.size(), 2u);
  ASSERT_EQ(deleted.laps.size(), 2u);
  EXPECT_LT(submaps.error_after_loop_m, 0.4 * submaps.error_before_loop_m);
  EXPECT_LT(submaps.laps[1].error_m, 0.5 * deleted.laps[1].error_m);
  // The map that is held is small: of 40 measured features a frame, many times as many are kept.
  EXPECT_GT(submaps.laps[0].points, 3 * submaps.laps[0].active_most);
  EXPECT_LT(submaps.laps[1].trunk, 0.15 * submaps.laps[1].points);
  EXPECT_LT(submaps.laps[1].points, 1.1 * submaps.laps[0].points);
  EXPECT_EQ(deleted.laps[1].leaves, 0);
}

TEST(CorridorLaps, InformationChoosesSeparatorsThatLoseLess) {
  CorridorOptions options;
  options.laps = 0.9;
  options.compared_separators = 6;
  const CorridorResult run = runCorridorLaps(options, 2);
  ASSERT_GE(run.compared.size(), 5u);
  std::vector<double> information, naive;
  for (const ComparedBits& bits : run.compared) {
    information.push_back(bits.information_bits);
    naive.push_back(bits.naive_bits);
    EXPECT_LT(bits.information_bits, bits.naive_bits);
  }
  EXPECT_LT(meanOf(information), 0.7 * meanOf(naive));
}

TEST(CorridorLaps, AreTheSameForTheSameSeed) {
  CorridorOptions options;
  options.laps = 0.3;
  options.maximum_features = 80;
  const CorridorResult first = runCorridorLaps(options, 3), second = runCorridorLaps(options, 3);
  EXPECT_FALSE(first.lost_bits.empty());
  EXPECT_EQ(first.lost_bits, second.lost_bits);
  EXPECT_EQ(first.laps[0].nees, second.laps[0].nees);
  EXPECT_NE(first.laps[0].nees, runCorridorLaps(options, 4).laps[0].nees);
}

}  // namespace
}  // namespace active_matching_slam
