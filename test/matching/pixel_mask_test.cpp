#include "active_matching_slam/matching/pixel_mask.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <utility>

namespace active_matching_slam {
namespace {

TEST(PixelMask, AgreesWithASetOfPixelsUnderRandomRuns) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> row(-4, 4), column(-20, 20), length(0, 9);
  PixelMask mask;
  std::set<std::pair<int, int>> plain;
  for (int n = 0; n < 400; ++n) {
    const int v = row(random), begin = column(random);
    const PixelRun run{v, begin, begin + length(random)};
    int missing = 0;
    for (int u = run.begin_u; u < run.end_u; ++u) missing += plain.count({v, u}) == 0;
    EXPECT_EQ(missing, mask.countMissing(run));
    std::vector<PixelRun> added;
    EXPECT_EQ(missing, mask.insert(run, &added));
    int added_pixels = 0;
    for (const PixelRun& part : added) {
      EXPECT_EQ(v, part.v);
      for (int u = part.begin_u; u < part.end_u; ++u) {
        EXPECT_TRUE(plain.insert({v, u}).second);
        ++added_pixels;
      }
    }
    EXPECT_EQ(missing, added_pixels);
    EXPECT_EQ(static_cast<std::int64_t>(plain.size()), mask.size());
  }
  for (int v = -6; v <= 6; ++v)
    for (int u = -22; u <= 32; ++u) EXPECT_EQ(plain.count({v, u}) == 1, mask.contains(u, v));
  // Runs come sorted, disjoint and maximal.
  PixelRun before{-100, 0, 0};
  std::size_t pixels = 0;
  mask.forEachRun([&](const PixelRun& run) {
    EXPECT_LT(run.begin_u, run.end_u);
    if (run.v == before.v) {
      EXPECT_GT(run.begin_u, before.end_u);
    } else {
      EXPECT_GT(run.v, before.v);
    }
    pixels += static_cast<std::size_t>(run.end_u - run.begin_u);
    before = run;
  });
  EXPECT_EQ(plain.size(), pixels);
}

TEST(PixelMask, IsEmptyAfterClear) {
  PixelMask mask;
  mask.insert({7, 1, 5});
  EXPECT_TRUE(mask.contains(4, 7));
  EXPECT_FALSE(mask.contains(5, 7));
  mask.clear();
  EXPECT_EQ(0, mask.size());
  EXPECT_FALSE(mask.contains(4, 7));
  EXPECT_EQ(0, mask.insert({0, 3, 3}));
}

}  // namespace
}  // namespace active_matching_slam
