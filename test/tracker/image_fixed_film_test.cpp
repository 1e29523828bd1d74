// Films with something in each image that is no part of the scene.

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

/// The slow film, with something in each image from the `first` on.
Film spoiledFilm(int first, const std::function<void(cv::Mat*)>& spoil) {
  Film film = slowFilm();
  for (std::size_t i = static_cast<std::size_t>(first); i < film.frames.size(); ++i) {
    film.frames[i].image = film.frames[i].image.clone();
    spoil(&film.frames[i].image);
  }
  return film;
}

/// The camera must be tracked on its path from the `settled` image on, and the thing told: so many
/// pixels.
void expectScene(const Film& film, int settled, double least_px, double most_px) {
  Tracker tracker = slowTracker();
  const int count = static_cast<int>(film.frames.size());
  const Frames frames = trackFrames(film, &tracker, 0, count);
  for (int i = settled; i < count; ++i) {
    EXPECT_EQ(frames[i]->state, TrackingState::kTracking) << i << ": " << frames[i]->reason;
    EXPECT_EQ(frames[i]->map, frames[settled]->map) << i << ": " << frames[i]->reason;
  }
  const PathFit fit = fitPath(film, Frames(frames.begin() + settled, frames.end()), settled);
  EXPECT_LT(fit.rms_m, 2.0 * kFractionOfPath * fit.path_m);
  const TrackedFrame& last = *frames.back();
  const double fixed_px = last.image_fixed * static_cast<double>(last.image.total());
  EXPECT_GT(fixed_px, least_px);
  EXPECT_LT(fixed_px, most_px);
  EXPECT_FALSE(last.mask.empty());
  EXPECT_NE(imageFixedMessage(last.image_fixed).find("fixed"), std::string::npos);
}

TEST(ImageFixedFilms, TheDotsOfAProjectorDoNotHoldTheCamera) {
  constexpr int kDots = 60, kRadius_px = 2;
  cv::RNG random(7);
  std::vector<cv::Point> dots;
  for (int i = 0; i < kDots; ++i) dots.emplace_back(random.uniform(5, 315), random.uniform(5, 235));
  const Film film = spoiledFilm(0, [&dots](cv::Mat* image) {
    for (const cv::Point& dot : dots) cv::circle(*image, dot, kRadius_px, 255, cv::FILLED);
  });
  // A dot is five pixels wide, and seen by templates of 11 px in 15 x 15.
  expectScene(film, 90, kDots * 5.0 * 5.0, kDots * 15.0 * 15.0);
}

TEST(ImageFixedFilms, AGripperThatComesIntoViewIsNoPartOfTheScene) {
  const cv::Rect place(110, 130, 130, 110);
  cv::Mat gripper(place.size(), CV_8U);
  cv::RNG(5).fill(gripper, cv::RNG::UNIFORM, 20, 235);
  cv::GaussianBlur(gripper, gripper, {}, 1.2);
  cv::normalize(gripper, gripper, 30, 220, cv::NORM_MINMAX);
  const Film film = spoiledFilm(60, [&](cv::Mat* image) { gripper.copyTo((*image)(place)); });
  expectScene(film, 90, 0.5 * place.area(), 1.5 * place.area());
}

TEST(ImageFixedFilms, OfAFilmWithoutAnyNothingIsLeftOut) {
  Tracker tracker = slowTracker();
  const Frames frames = trackFrames(slowFilm(), &tracker, 0, 180);
  for (const auto& frame : frames) EXPECT_LT(frame->image_fixed, 0.005) << frame->index;
  EXPECT_EQ(frames.back()->map, 0);
  EXPECT_TRUE(imageFixedMessage(0.0).empty());
}

}  // namespace
}  // namespace active_matching_slam
