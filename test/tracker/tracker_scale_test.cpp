#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

TEST(TrackerScale, ScalesCameraAndMapTogether) {
  const Film& film = slowFilm();
  const double factor = 2.5;
  Tracker tracker = slowTracker();
  const auto before = trackFrames(film, &tracker, 0, 90).back();
  tracker.setScale(factor);
  // A repeated image shows the state as it is.
  const auto after = tracker.track(film.frames[89].image, before->stamp_s + 0.001);
  ASSERT_TRUE(after->repeated_image);
  EXPECT_EQ(after->scale_source, ScaleSource::kService);
  EXPECT_TRUE(after->camera.position_world.isApprox(factor * before->camera.position_world, 1e-12));
  EXPECT_TRUE(after->camera.velocity_world.isApprox(factor * before->camera.velocity_world, 1e-12));
  EXPECT_TRUE((after->camera_covariance.topLeftCorner<3, 3>().isApprox(
      factor * factor * before->camera_covariance.topLeftCorner<3, 3>(), 1e-9)));
  ASSERT_EQ(after->features.size(), before->features.size());
  for (std::size_t i = 0; i < after->features.size(); ++i)
    EXPECT_TRUE(after->features[i].position_world.isApprox(
        factor * before->features[i].position_world, 1e-9));
}

TEST(TrackerScale, TracksOnInTheNewScale) {
  const Film& film = slowFilm();
  const double factor = 0.1;
  Tracker tracker = slowTracker(), plain = slowTracker();
  trackFrames(film, &tracker, 0, 90);
  trackFrames(film, &plain, 0, 90);
  tracker.setScale(factor);
  const Frames scaled = trackFrames(film, &tracker, 90, 180);
  const Frames unscaled = trackFrames(film, &plain, 90, 180);
  int matched_scaled = 0, matched_unscaled = 0;
  for (int i = 0; i < 90; ++i) {
    EXPECT_EQ(scaled[i]->state, TrackingState::kTracking) << "frame " << 90 + i;
    matched_scaled += scaled[i]->nis_degrees / 2;
    matched_unscaled += unscaled[i]->nis_degrees / 2;
  }
  EXPECT_GT(matched_scaled, 0.9 * matched_unscaled) << "first views are scaled too";
  const PathFit one = fitPath(film, scaled, 90), other = fitPath(film, unscaled, 90);
  EXPECT_NEAR(one.scale * factor / other.scale, 1.0, 0.02);
  EXPECT_LT(one.rms_m, kFractionOfPath * one.path_m);
}

TEST(TrackerScale, RefusesAScaleThatIsNone) {
  Tracker tracker = slowTracker();
  trackFrames(slowFilm(), &tracker, 0, 3);
  for (const double factor : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                              std::numeric_limits<double>::infinity()})
    EXPECT_THROW(tracker.setScale(factor), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
