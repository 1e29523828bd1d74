#include "active_matching_slam/tracker/tracking_quality.h"

#include <gtest/gtest.h>

namespace active_matching_slam {
namespace {

constexpr double kInterval_s = 1.0 / 30.0;
// As with a right calibration, and with a wrong one.
const QualitySigns good{60, 54, 2, 3.0}, scattered{60, 45, 4, 80.0}, torn{60, 20, 20, 40.0};

void watch(const QualitySigns& signs, double seconds, TrackingQuality* quality,
           const CameraState& camera = {}) {
  for (double s = 0.0; s < seconds; s += kInterval_s)
    quality->add(kInterval_s, signs, camera, FilterOptions());
}

TEST(TrackingQuality, SaysNothingBeforeASecond) {
  TrackingQuality quality;
  watch(torn, 0.5, &quality);
  EXPECT_EQ(quality.quality(), 1.0);
  EXPECT_EQ(quality.cause(), "");
  watch(torn, 1.0, &quality);
  EXPECT_LT(quality.quality(), 0.5);
}

TEST(TrackingQuality, IsHighWhileAllIsWellAndFallsAndRisesWithinSeconds) {
  TrackingQuality quality;
  watch(good, 5.0, &quality);
  const double before = quality.quality();
  EXPECT_GT(before, 0.5);
  EXPECT_EQ(quality.cause(), "");
  watch(torn, 3.0, &quality);
  EXPECT_LT(quality.quality(), 0.1);
  EXPECT_NE(quality.cause(), "");
  watch(good, 6.0, &quality);
  EXPECT_NEAR(quality.quality(), before, 0.05);
  EXPECT_EQ(quality.cause(), "");
}

TEST(TrackingQuality, NamesTheLikelyCause) {
  TrackingQuality scatter, moving, lens;
  watch(scattered, 3.0, &scatter);
  EXPECT_NE(scatter.cause().find("scatter"), std::string::npos) << scatter.cause();
  watch(torn, 3.0, &moving);
  EXPECT_NE(moving.cause().find("move"), std::string::npos) << moving.cause();
  CameraState camera;
  camera.lens.radial = 30.0 * FilterOptions().initial_sigma_radial;
  watch(scattered, 3.0, &lens, camera);
  EXPECT_NE(lens.cause().find("lens"), std::string::npos) << lens.cause();
}

TEST(TrackingQuality, ImagesThatTellNothingChangeNothing) {
  TrackingQuality quality;
  watch(good, 3.0, &quality);
  const double before = quality.quality();
  watch({0, 0, 0, 3.0}, 3.0, &quality);
  watch({60, 0, 0, 0.0}, 3.0, &quality);
  EXPECT_EQ(quality.quality(), before);
}

}  // namespace
}  // namespace active_matching_slam
