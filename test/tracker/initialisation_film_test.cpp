// The first images as cameras deliver them: short rendered films with what spoils a start.

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

/// The slow film's first seconds, each image changed.
Film changedFilm(int count, const std::function<void(int, cv::Mat*)>& change) {
  Film film = slowFilm();
  film.frames.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    cv::Mat& image = film.frames[i].image;
    image = image.clone();
    change(i, &image);
  }
  return film;
}

/// A camera that is tracked to the end on the path that it went.
void expectTracked(const Film& film, const Frames& frames, int from) {
  for (std::size_t i = 0; i < frames.size(); ++i)
    EXPECT_EQ(frames[i]->state, TrackingState::kTracking) << i << ": " << frames[i]->reason;
  const PathFit fit = fitPath(film, Frames(frames.begin() + from, frames.end()), from);
  EXPECT_LT(fit.rms_m, 2.0 * kFractionOfPath * fit.path_m);
}

// A clock, as cameras burn it in. Where most corners are of text, most of the image is at rest, and
// so is the camera, as far as anybody can tell.
TEST(InitialisationFilms, AClockThatIsBurntInIsNoPartOfTheScene) {
  const Film film = changedFilm(120, [](int, cv::Mat* image) {
    cv::putText(*image, "CAM 2  17:35:00", {20, 30}, cv::FONT_HERSHEY_SIMPLEX, 0.6,
                cv::Scalar(255));
  });
  Tracker tracker = slowTracker();
  expectTracked(film, trackFrames(film, &tracker, 0, 120), 10);
}

TEST(InitialisationFilms, AFirstImageFromAnOldBufferIsDropped) {
  SimulatorOptions other = filmOptions(0.1);
  other.seed = 7;
  other.scene = "walkway";
  const cv::Mat old_image = makeFilm(other).frames.front().image;
  const Film film = changedFilm(90, [&old_image](int i, cv::Mat* image) {
    if (i == 0) *image = old_image.clone();
  });
  Tracker tracker = slowTracker();
  const Frames frames = trackFrames(film, &tracker, 0, 90);
  EXPECT_NE(frames[1]->reason.find("first image"), std::string::npos) << frames[1]->reason;
  expectTracked(film, frames, 2);
  // The second is the first of the map: its camera is the world's origin.
  EXPECT_LT(frames[1]->camera.position_world.norm(), 1e-9);
}

TEST(InitialisationFilms, LightsThatFlickerDoNotKeepItFromStarting) {
  const Film film = changedFilm(120, [](int i, cv::Mat* image) {
    constexpr double kGains[] = {1.0, 0.75, 0.5, 0.75};  // 100 Hz lamps, sampled
    image->convertTo(*image, CV_8U, kGains[i % 4]);
  });
  Tracker tracker = slowTracker();
  expectTracked(film, trackFrames(film, &tracker, 0, 120), 10);
}

TEST(InitialisationFilms, ACameraThatGoesForwardStarts) {
  SimulatorOptions options = filmOptions(4.0);
  options.motion = "forward";
  options.scene = "office";
  const Film film = makeFilm(options);
  Tracker tracker(film.camera, TrackerOptions());
  const int count = static_cast<int>(film.frames.size());
  expectTracked(film, trackFrames(film, &tracker, 0, count), 30);
}

constexpr double kSwing_rad = 0.35;
double panAt(int i) { return kSwing_rad * std::sin(2.0 * M_PI * i / 120.0); }

/// A camera 63 degrees wide that turns about its centre: views of one image of a wider lens, past
/// any parallax.
Film panningFilm(int count) {
  SimulatorOptions options = filmOptions(0.0, {1280, 960});
  options.distortion = "equidistant";
  const Film wide = makeFilm(options);
  Film film{CameraModel(makeSimulatedCalibration(320, 240, "none")), {}};
  for (int i = 0; i < count; ++i) {
    const Eigen::AngleAxisd turned(panAt(i), Eigen::Vector3d::UnitY());
    cv::Mat map(240, 320, CV_32FC2);
    for (int v = 0; v < 240; ++v)
      for (int u = 0; u < 320; ++u) {
        const auto pixel = wide.camera.project(turned * *film.camera.unproject({u, v}));
        map.at<cv::Vec2f>(v, u) = cv::Vec2f(static_cast<float>(pixel->x()),  //
                                            static_cast<float>(pixel->y()));
      }
    SimulatedFrame frame;
    frame.index = i;
    frame.stamp_s = 1.0 + i / 30.0;
    frame.truth = wide.frames.front().truth;
    cv::remap(wide.frames.front().image, frame.image, map, cv::noArray(), cv::INTER_CUBIC);
    cv::Mat noise(frame.image.size(), CV_16S);
    cv::RNG random(static_cast<std::uint64_t>(i));
    random.fill(noise, cv::RNG::NORMAL, 0, 1.5);
    cv::add(frame.image, noise, frame.image, cv::noArray(), CV_8U);
    film.frames.push_back(frame);
  }
  return film;
}

TEST(InitialisationFilms, ACameraThatOnlyTurnsIsFollowedAndStaysWhereItIs) {
  constexpr int kImages = 240;
  const Film film = panningFilm(kImages);
  Tracker tracker(film.camera, TrackerOptions());
  const Frames frames = trackFrames(film, &tracker, 0, kImages);
  for (int i = 0; i < kImages; ++i) {
    EXPECT_EQ(frames[i]->state, TrackingState::kTracking) << i << ": " << frames[i]->reason;
    const Eigen::Quaterniond truth(Eigen::AngleAxisd(panAt(i), Eigen::Vector3d::UnitY()));
    EXPECT_LT(frames[i]->camera.q_world_camera.angularDistance(truth), 0.02) << i;
  }
}

}  // namespace
}  // namespace active_matching_slam
