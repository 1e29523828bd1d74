#include "active_matching_slam/tracker/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/simulation/simulator.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

std::set<FeatureId> ids(const TrackedFrame& frame) {
  std::set<FeatureId> result;
  for (const TrackedFeature& feature : frame.features) result.insert(feature.id);
  return result;
}

cv::Mat noiseImage(int seed) {
  cv::Mat image(240, 320, CV_8UC1);
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

const cv::Mat& blackImage() {
  static const cv::Mat image = cv::Mat::zeros(240, 320, CV_8UC1);
  return image;
}

/// Frames of the slow film with up to a few replaced.
Film spoiltFilm(int first, int count, const std::function<cv::Mat(int)>& image) {
  Film film = slowFilm();
  for (int i = 0; i < count; ++i) film.frames[first + i].image = image(i);
  return film;
}

TEST(Tracker, FollowsASlowCameraToTheEnd) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker();
  const Frames frames = trackFrames(film, &tracker, 0, static_cast<int>(film.frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i]->state, TrackingState::kTracking) << "frame " << i;
    ASSERT_TRUE(isFinite(*frames[i])) << "frame " << i;
    EXPECT_EQ(frames[i]->reason, "") << "frame " << i;
    EXPECT_EQ(frames[i]->index, static_cast<std::int64_t>(i));
  }
  const PathFit fit = fitPath(film, frames);
  RecordProperty("rms_mm", std::to_string(1e3 * fit.rms_m));
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m) << fit.path_m << " m long";
}

TEST(Tracker, TakesAllThatTheFirstImageHas) {
  const TrackerOptions options;
  Tracker tracker = slowTracker();
  const cv::Mat& image = slowFilm().frames[0].image;
  const auto frame = tracker.track(image, 0.0);
  const auto corners = [&](const std::vector<Eigen::Vector2d>& occupied) {
    return detectCorners(image, occupied, options.map.features_per_frame,
                         options.map.minimum_distance_px, options.image);
  };
  const std::size_t started = frame->features.size();
  EXPECT_GT(started, corners({}).size()) << "one look finds one a cell";
  std::vector<Eigen::Vector2d> occupied;
  for (const TrackedFeature& feature : frame->features)
    occupied.push_back(*slowFilm().camera.project(feature.position_world));
  const auto limit = static_cast<std::size_t>(options.map.features_per_frame);
  EXPECT_TRUE(started == limit || corners(occupied).empty());
  EXPECT_EQ(frame->features_started, static_cast<int>(started));
}

TEST(Tracker, LearnsHowGoodMatchesAre) {
  const TrackerOptions options;
  Tracker tracker = slowTracker();
  const Frames frames = trackFrames(slowFilm(), &tracker, 0, 120);
  EXPECT_EQ(frames[1]->match_sigma_px, options.filter.sigma_px);
  EXPECT_LT(frames.back()->match_sigma_px, 0.8 * options.filter.sigma_px);
  EXPECT_GE(frames.back()->match_sigma_px, options.filter.minimum_sigma_px);

  tracker.reset("test");
  EXPECT_EQ(trackFrames(slowFilm(), &tracker, 120, 122).back()->match_sigma_px,
            options.filter.sigma_px);

  TrackerOptions never = options;
  never.filter.minimum_sigma_px = options.filter.sigma_px;
  Tracker other = slowTracker(never);
  for (const auto& frame : trackFrames(slowFilm(), &other, 0, 60))
    EXPECT_EQ(frame->match_sigma_px, frame->index == 0 ? 0.0 : options.filter.sigma_px);
}

TEST(Tracker, LearnsNoNoiseWhileDepthsAreAGuess) {
  // At first this camera all but rests: its matches are better than any that will come.
  SimulatorOptions simulation;
  simulation.motion = "jerky";
  simulation.seed = 2;
  simulation.duration_s = 0.4;
  Simulator simulator(simulation);
  const TrackerOptions options;
  Tracker tracker(simulator.camera(), options);
  while (const auto image = simulator.next()) {
    const auto frame = tracker.track(image->image, image->stamp_s);
    EXPECT_EQ(frame->match_sigma_px, image->index == 0 ? 0.0 : options.filter.sigma_px);
  }
}

TEST(Tracker, RepeatsItselfBitForBit) {
  Tracker one = slowTracker(), two = slowTracker();
  const Frames a = trackFrames(slowFilm(), &one, 0, 60);
  const Frames b = trackFrames(slowFilm(), &two, 0, 60);
  for (int i = 0; i < 60; ++i) EXPECT_TRUE(sameState(*a[i], *b[i])) << "frame " << i;
}

TEST(Tracker, CovarianceIsSymmetricAndPositive) {
  Tracker tracker = slowTracker();
  for (const auto& frame : trackFrames(slowFilm(), &tracker, 0, 60)) {
    const auto& P = frame->camera_covariance;
    EXPECT_TRUE(P.isApprox(P.transpose(), 1e-12));
    EXPECT_GT(P.diagonal().minCoeff(), 0.0);
    for (const TrackedFeature& feature : frame->features)
      EXPECT_GE(feature.covariance_world.diagonal().minCoeff(), 0.0);
  }
}

TEST(Tracker, IgnoresImagesThatItCanNotTrackAndSaysWhy) {
  const Film& film = slowFilm();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Tracker tracker = slowTracker(), undisturbed = slowTracker();
  trackFrames(film, &undisturbed, 0, 20);
  const auto last = trackFrames(film, &tracker, 0, 20).back();
  const double stamp_s = last->stamp_s;
  const cv::Mat& good = film.frames[20].image;
  cv::Mat colour, small, deep;
  cv::merge(std::vector<cv::Mat>{good, good, good}, colour);
  small = good(cv::Rect(0, 0, 160, 120)).clone();
  good.convertTo(deep, CV_16U);
  const struct {
    cv::Mat image;
    double stamp_s;
    const char* reason;
  } cases[] = {{cv::Mat(), stamp_s + 0.01, "empty"},
               {colour, stamp_s + 0.01, "8-bit grey"},
               {deep, stamp_s + 0.01, "8-bit grey"},
               {small, stamp_s + 0.01, "160 x 120"},
               {good, nan, "stamp is not a finite"},
               {good, std::numeric_limits<double>::infinity(), "stamp is not a finite"},
               {good, stamp_s, "stamp equals"}};
  for (const auto& bad : cases) {
    std::shared_ptr<const TrackedFrame> frame;
    ASSERT_NO_THROW(frame = tracker.track(bad.image, bad.stamp_s)) << bad.reason;
    EXPECT_NE(frame->reason.find(bad.reason), std::string::npos) << frame->reason;
    EXPECT_TRUE(sameState(*frame, *last)) << bad.reason;
    EXPECT_EQ(frame->resets, 0);
  }
  const Frames after = trackFrames(film, &tracker, 20, 30);
  const Frames expected = trackFrames(film, &undisturbed, 20, 30);
  for (int i = 0; i < 10; ++i)
    EXPECT_TRUE(sameState(*after[i], *expected[i])) << "nothing bad was remembered, frame " << i;
}

TEST(Tracker, RefusesBadImagesBeforeTheFirstGoodOne) {
  Tracker tracker = slowTracker();
  for (const cv::Mat& image : {cv::Mat(), cv::Mat(10, 10, CV_8UC3)}) {
    const auto frame = tracker.track(image, 0.5);
    EXPECT_EQ(frame->state, TrackingState::kWaiting);
    EXPECT_NE(frame->reason.find("image ignored"), std::string::npos);
    EXPECT_TRUE(isFinite(*frame));
  }
  EXPECT_EQ(trackFrames(slowFilm(), &tracker, 0, 2).back()->state, TrackingState::kTracking);
}

TEST(Tracker, StartsAnewWhenTheStampRunsBackAndSaysSo) {
  Tracker tracker = slowTracker();
  trackFrames(slowFilm(), &tracker, 40, 50);
  const auto frame = tracker.track(slowFilm().frames[5].image, slowFilm().frames[5].stamp_s);
  EXPECT_EQ(frame->resets, 1);
  EXPECT_NE(frame->reason.find("stamp ran back"), std::string::npos) << frame->reason;
  EXPECT_EQ(frame->state, TrackingState::kTracking);
  EXPECT_EQ(frame->camera.position_world, Eigen::Vector3d::Zero());
  const auto next = tracker.track(slowFilm().frames[6].image, slowFilm().frames[6].stamp_s);
  EXPECT_EQ(next->state, TrackingState::kTracking);
  EXPECT_EQ(next->reason, "");
  EXPECT_EQ(next->resets, 1);
}

TEST(Tracker, ALateImageIsLeftOutAndCountedAndTheMapIsKept) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker(), undisturbed = slowTracker();
  trackFrames(film, &tracker, 0, 30);
  trackFrames(film, &undisturbed, 0, 30);
  const auto late = tracker.track(film.frames[28].image, film.frames[28].stamp_s);
  EXPECT_NE(late->reason.find("late"), std::string::npos) << late->reason;
  EXPECT_EQ(late->late_images, 1);
  EXPECT_TRUE(late->image.empty()) << "nothing was made of it";
  const Frames after = trackFrames(film, &tracker, 30, 40);
  const Frames expected = trackFrames(film, &undisturbed, 30, 40);
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(sameState(*after[i], *expected[i])) << "frame " << i;
}

TEST(Tracker, AClockSetBackByALittleThrowsNothingAway) {
  Film film = slowFilm();
  for (std::size_t i = 30; i < film.frames.size(); ++i) film.frames[i].stamp_s -= 0.04;
  Tracker tracker(film.camera, {});
  const Frames frames = trackFrames(film, &tracker, 0, 60);
  EXPECT_EQ(frames.back()->state, TrackingState::kTracking);
  EXPECT_EQ(frames.back()->resets, 0);
  EXPECT_EQ(frames.back()->times_lost, 0);
  EXPECT_EQ(frames.back()->late_images, 1);
}

TEST(Tracker, IsAsNewAfterAReset) {
  Tracker tracker = slowTracker(), fresh = slowTracker();
  trackFrames(slowFilm(), &tracker, 0, 20);
  tracker.reset("asked for");
  const Frames again = trackFrames(slowFilm(), &tracker, 0, 20);
  EXPECT_EQ(again.back()->resets, 1);
  EXPECT_EQ(again.back()->state, TrackingState::kTracking);
  const auto expected = trackFrames(slowFilm(), &fresh, 0, 20).back();
  EXPECT_EQ(again.back()->camera.position_world, expected->camera.position_world);
  EXPECT_EQ(again.back()->camera_covariance, expected->camera_covariance);
}

TEST(Tracker, WaitsForLightAtTheStart) {
  const Film film = spoiltFilm(0, 10, [](int) { return blackImage(); });
  Tracker tracker = slowTracker();
  for (const auto& frame : trackFrames(film, &tracker, 0, 10)) {
    EXPECT_EQ(frame->state, TrackingState::kInitialising);
    EXPECT_NE(frame->reason.find("blank"), std::string::npos) << frame->reason;
    EXPECT_TRUE(isFinite(*frame));
    EXPECT_TRUE(frame->features.empty());
  }
  const Frames frames = trackFrames(film, &tracker, 10, 60);
  for (const auto& frame : frames) EXPECT_EQ(frame->state, TrackingState::kTracking);
}

TEST(Tracker, SurvivesTheDark) {
  const Film film = spoiltFilm(60, 10, [](int) { return blackImage(); });
  Tracker tracker = slowTracker();
  trackFrames(film, &tracker, 0, 60);
  for (const auto& frame : trackFrames(film, &tracker, 60, 70)) {
    EXPECT_TRUE(isFinite(*frame));
    if (!frame->repeated_image) {
      EXPECT_NE(frame->reason.find("features matched"), std::string::npos) << frame->reason;
    }
  }
  const Frames after = trackFrames(film, &tracker, 70, 180);
  EXPECT_TRUE(std::all_of(after.begin(), after.end(), [](const auto& f) { return isFinite(*f); }));
  EXPECT_EQ(after.back()->state, TrackingState::kTracking);
  EXPECT_EQ(after.back()->resets, 0);
  const PathFit fit = fitPath(film, Frames(after.begin() + 10, after.end()), 80);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
}

TEST(Tracker, IsLostInTheDarkAndClaimsSoAfterTheFramesAllowed) {
  // Slightly different images, so that none repeats the one before.
  const Film film = spoiltFilm(30, 30, [](int i) {
    cv::Mat image = blackImage().clone();
    image.at<std::uint8_t>(100, 100 + i) = 10;
    return image;
  });
  TrackerOptions options;
  Tracker tracker = slowTracker(options);
  trackFrames(film, &tracker, 0, 30);
  const Frames dark = trackFrames(film, &tracker, 30, 60);
  for (int i = 0; i < 30; ++i)
    EXPECT_EQ(dark[i]->state,
              i + 1 < options.lost_after_frames ? TrackingState::kTracking : TrackingState::kLost)
        << "dark frame " << i;
  EXPECT_EQ(dark.back()->times_lost, 1);
  EXPECT_NE(dark.back()->reason, "");
  EXPECT_TRUE(isFinite(*dark.back()));
}

TEST(Tracker, FindsItselfAfterBeingLost) {
  const Film film = spoiltFilm(60, 20, [](int i) {
    cv::Mat image = blackImage().clone();
    image.at<std::uint8_t>(100, 100 + i) = 10;
    return image;
  });
  Tracker tracker = slowTracker();
  trackFrames(film, &tracker, 0, 60);
  EXPECT_EQ(trackFrames(film, &tracker, 60, 80).back()->state, TrackingState::kLost);
  const Frames after = trackFrames(film, &tracker, 80, 180);
  EXPECT_EQ(after.back()->state, TrackingState::kTracking);
  EXPECT_EQ(after.back()->resets, 0);
  const PathFit fit = fitPath(film, Frames(after.begin() + 20, after.end()), 100);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
}

TEST(Tracker, IsNotFooledByNoise) {
  const Film film = spoiltFilm(60, 6, noiseImage);
  Tracker tracker = slowTracker();
  trackFrames(film, &tracker, 0, 60);
  for (const auto& frame : trackFrames(film, &tracker, 60, 66)) {
    EXPECT_TRUE(isFinite(*frame));
    EXPECT_NE(frame->reason, "");
  }
  const Frames after = trackFrames(film, &tracker, 66, 180);
  EXPECT_EQ(after.back()->state, TrackingState::kTracking);
  const PathFit fit = fitPath(film, Frames(after.begin() + 10, after.end()), 76);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
}

TEST(Tracker, StaysFiniteWhenItStartsOnNoise) {
  Tracker tracker = slowTracker();
  int resets = 0, since_start = 0;
  for (int i = 0; i < 40; ++i) {
    std::shared_ptr<const TrackedFrame> frame;
    ASSERT_NO_THROW(frame = tracker.track(noiseImage(i), 1.0 + i / 30.0));
    EXPECT_TRUE(isFinite(*frame)) << "frame " << i;
    if (since_start > 2) {
      EXPECT_NE(frame->reason, "") << "frame " << i;
    }
    since_start = frame->resets == resets ? since_start + 1 : 0;
    resets = frame->resets;
  }
  EXPECT_GT(resets, 0) << "a map of noise can't be found again";
}

TEST(Tracker, LearnsNothingFromARepeatedImage) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker(), plain = slowTracker();
  trackFrames(film, &plain, 0, 30);
  const auto last = trackFrames(film, &tracker, 0, 30).back();
  const auto repeated = tracker.track(film.frames[29].image.clone(), last->stamp_s + 0.005);
  EXPECT_TRUE(repeated->repeated_image);
  EXPECT_EQ(repeated->state, TrackingState::kTracking);
  EXPECT_TRUE(sameState(*repeated, *last));
  const Frames a = trackFrames(film, &tracker, 30, 40), b = trackFrames(film, &plain, 30, 40);
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(sameState(*a[i], *b[i])) << "frame " << i;
}

TEST(Tracker, ChangesItsMatcherWithoutLosingTheMap) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker();
  Frames frames = trackFrames(film, &tracker, 0, 30);
  int next = 30;
  for (const std::string& name : matcherNames()) {
    const auto before = ids(*frames.back());
    TrackerOptions options = tracker.options();
    options.matcher = name;
    tracker.setOptions(options);
    EXPECT_EQ(tracker.options().matcher, name);
    const Frames some = trackFrames(film, &tracker, next, next + 10);
    next += 10;
    for (const auto& frame : some) {
      EXPECT_EQ(frame->state, TrackingState::kTracking) << name;
      EXPECT_EQ(frame->reason, "") << name;
    }
    const auto after = ids(*some.back());
    std::vector<FeatureId> kept;
    std::set_intersection(before.begin(), before.end(), after.begin(), after.end(),
                          std::back_inserter(kept));
    EXPECT_GT(2 * kept.size(), before.size()) << name;
    frames.insert(frames.end(), some.begin(), some.end());
  }
  EXPECT_EQ(frames.back()->resets, 0);
  const PathFit fit = fitPath(film, frames);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
}

TEST(Tracker, MeasuresAsManyFeaturesAsItIsTold) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker();
  trackFrames(film, &tracker, 0, 30);
  int next = 30;
  for (const int wanted : {15, 40, 8, 60}) {
    TrackerOptions options = tracker.options();
    options.map.features_per_frame = wanted;
    tracker.setOptions(options);
    for (const auto& frame : trackFrames(film, &tracker, next, next + 10)) {
      EXPECT_EQ(frame->state, TrackingState::kTracking);
      EXPECT_LE(frame->prior.size(), wanted);
      EXPECT_GE(frame->prior.size(), std::min(wanted, 15));
      EXPECT_EQ(frame->resets, 0);
    }
    next += 10;
  }
}

TEST(Tracker, ShrinksTheMapWhenItsMaximumIsLowered) {
  Tracker tracker = slowTracker();
  EXPECT_GT(trackFrames(slowFilm(), &tracker, 0, 30).back()->features.size(), 30u);
  TrackerOptions options = tracker.options();
  options.map.features_per_frame = 20;
  options.map.maximum_features = 30;
  tracker.setOptions(options);
  for (const auto& frame : trackFrames(slowFilm(), &tracker, 30, 60)) {
    EXPECT_LE(frame->features.size(), 30u);
    EXPECT_EQ(frame->state, TrackingState::kTracking);
  }
}

TEST(Tracker, RefusesBadOptionsAndKeepsItsOwn) {
  Tracker tracker = slowTracker();
  trackFrames(slowFilm(), &tracker, 0, 5);
  TrackerOptions bad = tracker.options();
  bad.filter.sigma_px = -1.0;
  EXPECT_THROW(tracker.setOptions(bad), std::invalid_argument);
  bad = tracker.options();
  bad.matcher = "guess";
  EXPECT_THROW(tracker.setOptions(bad), std::invalid_argument);
  EXPECT_THROW(Tracker(slowFilm().camera, bad), std::invalid_argument);
  bad = tracker.options();
  bad.image.template_size_px += 2;
  EXPECT_THROW(tracker.setOptions(bad), std::invalid_argument);
  EXPECT_EQ(tracker.options().matcher, TrackerOptions().matcher);
  EXPECT_EQ(tracker.options().filter.sigma_px, TrackerOptions().filter.sigma_px);
  EXPECT_EQ(trackFrames(slowFilm(), &tracker, 5, 6).back()->state, TrackingState::kTracking);
}

TEST(Tracker, NeverHoldsMoreFeaturesThanAllowed) {
  SimulatorOptions simulation = filmOptions(20.0);
  simulation.scene = "wall";
  simulation.motion = "sideways";
  simulation.rate_hz = 15.0;
  const Film film = makeFilm(simulation);
  TrackerOptions options;
  options.map.features_per_frame = 25;
  options.map.maximum_features = 40;
  Tracker tracker(film.camera, options);
  const Frames frames = trackFrames(film, &tracker, 0, static_cast<int>(film.frames.size()));
  std::size_t most = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    most = std::max(most, frames[i]->features.size());
    EXPECT_LE(frames[i]->features.size(), 40u) << "frame " << i;
    EXPECT_TRUE(isFinite(*frames[i])) << "frame " << i;
  }
  EXPECT_EQ(most, 40u) << "the limit was met";
  EXPECT_EQ(frames.back()->state, TrackingState::kTracking);
}

TEST(Tracker, SurvivesAnOccluderForHalfASecond) {
  // A textured board hides two thirds of the view and moves along.
  const cv::Mat texture = noiseImage(7);
  cv::Mat board;
  cv::GaussianBlur(texture, board, cv::Size(), 3.0);
  cv::normalize(board, board, 20, 230, cv::NORM_MINMAX);
  Film film = slowFilm();
  for (int i = 0; i < 15; ++i) {
    cv::Mat image = film.frames[60 + i].image.clone();
    const int left = 8 * i, width = std::min(214, 320 - left);
    board(cv::Rect(0, 0, width, 240)).copyTo(image(cv::Rect(left, 0, width, 240)));
    film.frames[60 + i].image = image;
  }
  Tracker tracker = slowTracker();
  const Frames frames = trackFrames(film, &tracker, 0, 180);
  for (int i = 0; i < 180; ++i) {
    EXPECT_EQ(frames[i]->state, TrackingState::kTracking) << "frame " << i;
    EXPECT_TRUE(isFinite(*frames[i])) << "frame " << i;
  }
  const PathFit fit = fitPath(film, frames);
  EXPECT_LT(fit.rms_m, 2.0 * kFractionOfPath * fit.path_m);
}

TEST(Tracker, AccountsForEveryCandidate) {
  Tracker tracker = slowTracker();
  for (const auto& frame : trackFrames(slowFilm(), &tracker, 1, 40)) {
    const auto statuses = [&](FeatureStatus status) {
      return std::count_if(frame->features.begin(), frame->features.end(),
                           [&](const TrackedFeature& f) { return f.status == status; });
    };
    EXPECT_EQ(frame->prior.ids.size(), frame->matches.size());
    for (const TrackedFeature& feature : frame->features) {
      EXPECT_LE(feature.successes, feature.attempts);
      EXPECT_FALSE(feature.known);
      if (feature.status == FeatureStatus::kMatched) {
        EXPECT_GE(feature.score, tracker.options().image.match_threshold);
        EXPECT_GE(feature.successes, 1);
      }
    }
    EXPECT_LE(2 * statuses(FeatureStatus::kMatched), frame->nis_degrees);
  }
}

}  // namespace
}  // namespace active_matching_slam
