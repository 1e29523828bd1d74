// The same film at several sizes, and a camera that moves ahead.

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "simulated_frames.h"

namespace active_matching_slam {
namespace {

/// The images of a film and its camera, `factor` times as large.
Film enlarged(const Film& film, double factor) {
  CameraCalibration calibration = film.camera.calibration();
  const cv::Size size(static_cast<int>(std::lround(factor * calibration.width)),
                      static_cast<int>(std::lround(factor * calibration.height)));
  calibration.width = size.width;
  calibration.height = size.height;
  calibration.fx *= factor;
  calibration.fy *= factor;
  calibration.cx = factor * (calibration.cx + 0.5) - 0.5;
  calibration.cy = factor * (calibration.cy + 0.5) - 0.5;
  Film result{CameraModel(calibration), {}};
  for (const SimulatedFrame& frame : film.frames) {
    result.frames.push_back(frame);
    cv::resize(frame.image, result.frames.back().image, size, 0.0, 0.0,
               factor < 1.0 ? cv::INTER_AREA : cv::INTER_CUBIC);
  }
  return result;
}

TEST(ImageSize, AFilmOfAnySizeGivesTheSameTrajectory) {
  const Film film = makeFilm(filmOptions(3.0, {640, 480}));
  for (const double factor : {0.5, 1.0, 2.0, 3.0}) {
    const Film sized = enlarged(film, factor);
    Tracker tracker(sized.camera, {});
    const Frames frames = trackFrames(sized, &tracker, 0, static_cast<int>(sized.frames.size()));
    for (const auto& frame : frames) ASSERT_EQ(frame->state, TrackingState::kTracking) << factor;
    const PathFit fit = fitPath(sized, frames);
    std::printf("%.1f times 640 x 480, tracked as %d x %d: error %.2f %% of the path\n", factor,
                frames.back()->image.cols, frames.back()->image.rows,
                100.0 * fit.rms_m / fit.path_m);
    EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m) << factor;
    EXPECT_LE(frames.back()->image.total(), 800u * 600u);
    for (const TrackedFeature& feature : frames.back()->features)
      if (feature.status == FeatureStatus::kMatched)
        EXPECT_LT(feature.matched_px.x(), frames.back()->image.cols);
  }
}

TEST(ImageSize, AnImageOfTheSizeItIsTrackedAtIsNotTheOneThatWasPromised) {
  const Film film = makeFilm(filmOptions(0.1, {640, 480}));
  const Film large = enlarged(film, 2.0);
  Tracker tracker(large.camera, {});
  cv::Mat reduced;
  cv::resize(large.frames[0].image, reduced, {800, 600});
  EXPECT_NE(tracker.track(reduced, 1.0)->reason.find("the calibration 1280 x 960"),
            std::string::npos);
  EXPECT_EQ(tracker.track(large.frames[0].image, 2.0)->state, TrackingState::kTracking);
}

TEST(ImageSize, CanNotChangeWhileAMapIsKept) {
  Tracker tracker = slowTracker();
  TrackerOptions options = tracker.options();
  options.image.working_width = 400;
  EXPECT_THROW(tracker.setOptions(options), std::invalid_argument);
  EXPECT_EQ(tracker.options().image.working_width, TrackerOptions().image.working_width);
}

/// How much larger than at first a feature became that was matched in most of the frames: the most
/// of all features and frames.
double largestGrowth(const Frames& frames) {
  double growth = 0.0;
  for (const TrackedFeature& feature : frames.back()->features) {
    if (4 * feature.successes < 3 * static_cast<int>(frames.size())) continue;
    const auto distance = [&](const TrackedFrame& frame) {
      return (feature.position_world - frame.camera.position_world).norm();
    };
    for (const auto& frame : frames)
      growth = std::max(growth, distance(*frames.front()) / distance(*frame));
  }
  return growth;
}

TEST(GrowingFeatures, AreFollowedBeyondTheLargestScaleOfOnePatch) {
  SimulatorOptions scene = filmOptions(4.0, {640, 480});
  scene.motion = "forward";
  const Film film = makeFilm(scene);
  TrackerOptions narrow;
  narrow.map.maximum_scale = 1.2;
  narrow.map.minimum_scale = 1.0 / 1.2;
  Tracker tracker(film.camera, narrow);
  const Frames frames = trackFrames(film, &tracker, 0, static_cast<int>(film.frames.size()));
  for (const auto& frame : frames) EXPECT_EQ(frame->state, TrackingState::kTracking);
  const PathFit fit = fitPath(film, frames);
  const double growth = largestGrowth(frames);
  std::printf("forward: error %.2f %% of the path, features grew %.2f times\n",
              100.0 * fit.rms_m / fit.path_m, growth);
  EXPECT_GT(growth, narrow.map.maximum_scale);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
}

}  // namespace
}  // namespace active_matching_slam
