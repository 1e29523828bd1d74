// What is before the camera and not the scene.

#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgproc.hpp>

#include "support/fault.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

constexpr int kGripperFrom = 168;  ///< row: the lower 30 % of the image

cv::Mat gripperMask() {
  cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(255));
  mask.rowRange(kGripperFrom, 240).setTo(0);
  return mask;
}

/// The slow film behind a gripper, which is full of corners and trembles by a pixel.
const Film& gripperFilm() {
  static const Film film = [] {
    Film made = slowFilm();
    cv::RNG random(3);
    cv::Mat blocks(40, 80, CV_8UC1), gripper;
    random.fill(blocks, cv::RNG::UNIFORM, 0, 256);
    cv::resize(blocks, gripper, {}, 5.0, 5.0, cv::INTER_NEAREST);
    for (std::size_t i = 0; i < made.frames.size(); ++i) {
      cv::Mat& image = made.frames[i].image = made.frames[i].image.clone();
      const cv::Rect shown(20 + random.uniform(0, 2), 20 + random.uniform(0, 2), 320,
                           240 - kGripperFrom);
      gripper(shown).copyTo(image.rowRange(kGripperFrom, 240));
    }
    return made;
  }();
  return film;
}

int sizeOf(const Film& film) { return static_cast<int>(film.frames.size()); }

TEST(Mask, AGripperOverAThirdOfTheImageIsAsIfItWereNotThere) {
  Tracker tracker(gripperFilm().camera, {});
  tracker.setMask(gripperMask());
  const Frames frames = trackFrames(gripperFilm(), &tracker, 0, sizeOf(gripperFilm()));
  for (const auto& frame : frames) {
    ASSERT_EQ(frame->state, TrackingState::kTracking) << "frame " << frame->index;
    ASSERT_EQ(frame->resets, 0);
  }
  const PathFit fit = fitPath(gripperFilm(), frames);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m) << "as without a gripper";
  Tracker unmasked(gripperFilm().camera, {});
  const PathFit spoilt =
      fitPath(gripperFilm(), trackFrames(gripperFilm(), &unmasked, 0, sizeOf(gripperFilm())));
  RecordProperty("masked_mm", std::to_string(1e3 * fit.rms_m));
  RecordProperty("unmasked_mm", std::to_string(1e3 * spoilt.rms_m));
}

TEST(Mask, WhatIsBehindItPlaysNoPart) {
  Film other = gripperFilm();
  cv::RNG random(5);
  for (SimulatedFrame& frame : other.frames) {
    frame.image = frame.image.clone();
    cv::Mat behind = frame.image.rowRange(kGripperFrom, 240);
    random.fill(behind, cv::RNG::UNIFORM, 0, 256);
  }
  Tracker one(other.camera, {}), two(other.camera, {});
  one.setMask(gripperMask());
  two.setMask(gripperMask());
  const Frames a = trackFrames(gripperFilm(), &one, 0, 60), b = trackFrames(other, &two, 0, 60);
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(sameState(*a[i], *b[i])) << "frame " << i;
}

TEST(Mask, OneThatIsAllWhiteChangesNothingBitForBit) {
  Tracker without = slowTracker(), with = slowTracker();
  with.setMask(cv::Mat(240, 320, CV_8UC1, cv::Scalar(255)));
  const Frames a = trackFrames(slowFilm(), &without, 0, 60),
               b = trackFrames(slowFilm(), &with, 0, 60);
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(sameState(*a[i], *b[i])) << "frame " << i;
}

TEST(Mask, AFeatureBehindItIsNotVisibleAndNotBlamed) {
  const Film& film = slowFilm();
  Tracker tracker = slowTracker();
  const Frames before = trackFrames(film, &tracker, 0, 40);
  std::map<FeatureId, std::pair<int, int>> behind;  // attempts and successes
  for (const TrackedFeature& feature : before.back()->features)
    if (feature.status == FeatureStatus::kMatched && feature.matched_px.y() > 190.0)
      behind[feature.id] = {feature.attempts, feature.successes};
  ASSERT_GT(behind.size(), 3u);
  // Something moves in front of them, and the mask says so.
  Film covered = film;
  cv::RNG random(9);
  for (int i = 40; i < 70; ++i) {
    covered.frames[i].image = film.frames[i].image.clone();
    cv::Mat before_it = covered.frames[i].image.rowRange(kGripperFrom, 240);
    random.fill(before_it, cv::RNG::UNIFORM, 0, 256);
  }
  tracker.setMask(gripperMask());
  const Frames during = trackFrames(covered, &tracker, 40, 70);
  for (const auto& frame : during)
    for (const TrackedFeature& feature : frame->features) {
      if (feature.status == FeatureStatus::kMatched)
        EXPECT_LT(feature.matched_px.y(), kGripperFrom);
      if (feature.status == FeatureStatus::kMissed)
        EXPECT_LT(feature.predicted_px.y(), kGripperFrom);
    }
  int seen = 0;
  for (const TrackedFeature& feature : during.back()->features) {
    const auto it = behind.find(feature.id);
    if (it == behind.end() || feature.status != FeatureStatus::kNotVisible) continue;
    ++seen;
    EXPECT_EQ(feature.attempts - feature.successes, it->second.first - it->second.second)
        << "not missed once, feature " << feature.id;
  }
  EXPECT_GT(seen, 3) << "they are kept";
  tracker.setMask(cv::Mat());
  const auto after = trackFrames(film, &tracker, 70, 75).back();
  int matched = 0;
  for (const TrackedFeature& feature : after->features)
    matched += behind.count(feature.id) > 0 && feature.status == FeatureStatus::kMatched;
  EXPECT_GT(matched, 2) << "and found again";
}

TEST(Mask, OneOfAnotherSizeOrTypeIsRefusedByName) {
  Tracker tracker = slowTracker();
  EXPECT_NE(faultOf([&] {
              tracker.setMask(cv::Mat(480, 640, CV_8UC1, cv::Scalar(255)));
            }).find("640 x 480"),
            std::string::npos);
  EXPECT_NE(faultOf([&] { tracker.setMask(cv::Mat(240, 320, CV_8UC3)); }).find("8-bit grey"),
            std::string::npos);
  EXPECT_NE(faultOf([&] { tracker.setMask(cv::Mat::zeros(240, 320, CV_8UC1)); }).find("white"),
            std::string::npos);
  EXPECT_EQ(trackFrames(slowFilm(), &tracker, 0, 5).back()->state, TrackingState::kTracking);
}

}  // namespace
}  // namespace active_matching_slam
