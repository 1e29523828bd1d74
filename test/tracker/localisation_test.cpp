// Mapping off: the camera is found and followed in a map that stays as it was loaded.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "support/fault.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

constexpr int kMapped = 90;  ///< frames of the film from which the map is

TrackerOptions withoutMapping() {
  TrackerOptions options;
  options.mapping = false;
  return options;
}

class Localisation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    path_ = testing::TempDir() + "/localisation_test_" + std::to_string(::getpid()) + ".map";
    Tracker tracker = slowTracker();
    mapped_ = trackFrames(slowFilm(), &tracker, 0, kMapped);
    tracker.saveMap(path_);
  }
  static void TearDownTestSuite() {
    std::filesystem::remove(path_);
    mapped_.clear();
  }
  static std::string contentOfMap() {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  /// With the map loaded.
  struct Follower : Tracker {
    Follower() : Tracker(slowFilm().camera, withoutMapping()) { loadMap(path_); }
  };
  static int firstFound(const Frames& frames) {
    int first = 0;
    for (const auto& frame : frames) {
      if (frame->state == TrackingState::kTracking) break;
      ++first;
    }
    return first;
  }
  static std::string path_;
  static Frames mapped_;
};
std::string Localisation::path_;
Frames Localisation::mapped_;

TEST_F(Localisation, FindsAndFollowsTheCameraInTheMap) {
  const Film& film = slowFilm();
  const std::string file = contentOfMap();
  Follower tracker;
  const Frames frames = trackFrames(film, &tracker, kMapped, 180);
  const int found = firstFound(frames);
  ASSERT_LT(found, 10);
  for (std::size_t i = found; i < frames.size(); ++i)
    ASSERT_EQ(frames[i]->state, TrackingState::kTracking) << "frame " << i;
  // In the frame and the scale of the map.
  Frames whole = mapped_;
  whole.insert(whole.end(), frames.begin() + found, frames.end());
  Film joined{film.camera, {}};
  joined.frames.assign(film.frames.begin(), film.frames.begin() + kMapped);
  joined.frames.insert(joined.frames.end(), film.frames.begin() + kMapped + found,
                       film.frames.end());
  const PathFit fit = fitPath(joined, whole);
  EXPECT_LT(fit.rms_m, 2.0 * kFractionOfPath * fit.path_m);
  EXPECT_EQ(contentOfMap(), file) << "the file is the same after as before";
}

TEST_F(Localisation, TheMapStaysAsItWasLoadedToTheBit) {
  Follower tracker;
  const Frames frames = trackFrames(slowFilm(), &tracker, kMapped, 150);
  const TrackedFrame& first = *frames.front();
  ASSERT_GT(first.features.size(), 20u);
  for (const auto& frame : frames) {
    ASSERT_EQ(frame->features.size(), first.features.size());
    for (std::size_t i = 0; i < first.features.size(); ++i) {
      ASSERT_EQ(frame->features[i].id, first.features[i].id);
      ASSERT_EQ(frame->features[i].position_world, first.features[i].position_world);
      ASSERT_EQ(frame->features[i].covariance_world, first.features[i].covariance_world);
    }
    EXPECT_EQ(frame->features_started + frame->features_retired + frame->features_converted, 0);
  }
}

TEST_F(Localisation, TheCameraKnowsItsPlaceNoBetterThanTheMapIsKnown) {
  Follower following;
  Tracker mapping = slowTracker();
  mapping.loadMap(path_);
  const auto a = trackFrames(slowFilm(), &following, kMapped, 150).back();
  const auto b = trackFrames(slowFilm(), &mapping, kMapped, 150).back();
  ASSERT_EQ(a->state, TrackingState::kTracking);
  EXPECT_GT((a->camera_covariance.topLeftCorner<3, 3>().trace()),
            (b->camera_covariance.topLeftCorner<3, 3>().trace()))
      << "one that learns from what it sees goes on below that";
}

TEST_F(Localisation, WithoutAMapItWaitsAndSaysSo) {
  Tracker tracker = slowTracker(withoutMapping());
  const auto frame = trackFrames(slowFilm(), &tracker, 0, 5).back();
  EXPECT_EQ(frame->state, TrackingState::kWaiting);
  EXPECT_NE(frame->reason.find("no map"), std::string::npos) << frame->reason;
  EXPECT_TRUE(frame->features.empty());
}

TEST_F(Localisation, AResetLooksForTheCameraAnewAndKeepsTheMap) {
  Follower tracker;
  trackFrames(slowFilm(), &tracker, kMapped, 110);
  tracker.reset("asked for");
  const Frames again = trackFrames(slowFilm(), &tracker, 110, 130);
  EXPECT_EQ(again.back()->resets, 1);
  EXPECT_FALSE(again.front()->features.empty());
  EXPECT_EQ(again.back()->state, TrackingState::kTracking);
}

TEST_F(Localisation, WhatWouldChangeTheMapIsRefusedByName) {
  Follower tracker;
  trackFrames(slowFilm(), &tracker, kMapped, 95);
  EXPECT_NE(faultOf([&] { tracker.saveMap(path_ + "2"); }).find("mapping"), std::string::npos);
  EXPECT_NE(faultOf([&] { tracker.setScale(2.0); }).find("mapping"), std::string::npos);
}

TEST_F(Localisation, ElsewhereNoPoseIsClaimed) {
  SimulatorOptions options = filmOptions(2.0);
  options.scene = "office";
  options.seed = 5;
  const Film elsewhere = makeFilm(options);
  Follower tracker;
  for (const auto& frame : trackFrames(elsewhere, &tracker, 0, 60)) {
    EXPECT_EQ(frame->state, TrackingState::kLost);
    EXPECT_EQ(frame->resets, 0);
    EXPECT_FALSE(frame->features.empty()) << "the map is kept";
  }
}

/// Variances of a guess by hand.
Eigen::Matrix<double, 6, 6> guessed(double sigma_position, double sigma_rotation) {
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(sigma_position), Eigen::Vector3d::Constant(sigma_rotation);
  return sigma.cwiseAbs2().asDiagonal();
}

/// Of the frame of the film before the one that is looked at, in the map.
Eigen::Isometry3d lastMappedPose(const Frames& mapped) {
  return mapped.back()->camera.poseWorldCamera();
}

TEST_F(Localisation, AGivenPoseIsSearchedAtOnceInWideGates) {
  Follower tracker;
  // Not the first image, nor the fourth after: those are searched for the map without any guess.
  tracker.track(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), slowFilm().frames[kMapped - 1].stamp_s);
  Eigen::Isometry3d guess = lastMappedPose(mapped_);
  guess.translation() += Eigen::Vector3d(0.02, -0.01, 0.02);
  guess.rotate(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY()));
  tracker.setPose(guess, guessed(0.03, 0.05));
  const auto frame = trackFrames(slowFilm(), &tracker, kMapped, kMapped + 1).back();
  EXPECT_EQ(frame->state, TrackingState::kTracking) << frame->reason;
  EXPECT_LT((frame->camera.position_world - mapped_.back()->camera.position_world).norm(), 0.03);
  EXPECT_GT(trackFrames(slowFilm(), &tracker, kMapped + 1, kMapped + 5).back()->nis_degrees, 20);
}

TEST_F(Localisation, APoseThatIsWrongIsNotClaimed) {
  Follower tracker;
  trackFrames(slowFilm(), &tracker, kMapped, kMapped + 10);
  Eigen::Isometry3d wrong = lastMappedPose(mapped_);
  wrong.rotate(Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()));
  tracker.setPose(wrong, guessed(0.02, 0.02));
  const Film& film = slowFilm();
  // Black images: nothing bears it out.
  for (int i = kMapped + 10; i < kMapped + 20; ++i) {
    cv::Mat dark(240, 320, CV_8UC1, cv::Scalar(0));
    dark.at<std::uint8_t>(100, i) = 10;
    EXPECT_EQ(tracker.track(dark, film.frames[i].stamp_s)->state, TrackingState::kLost);
  }
  const Frames after = trackFrames(film, &tracker, kMapped + 20, kMapped + 40);
  EXPECT_EQ(after.back()->state, TrackingState::kTracking) << "found by the whole image";
}

TEST_F(Localisation, AGivenPoseThatIsNoneIsRefusedByName) {
  Tracker tracker = slowTracker(withoutMapping());
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  EXPECT_NE(faultOf([&] { tracker.setPose(pose, guessed(0.1, 0.1)); }).find("map"),
            std::string::npos);
  tracker.loadMap(path_);
  EXPECT_NE(faultOf([&] { tracker.setPose(pose, guessed(0.0, 0.1)); }).find("covariance"),
            std::string::npos);
  Eigen::Isometry3d odd = pose;
  odd.translation().x() = std::nan("");
  EXPECT_NE(faultOf([&] { tracker.setPose(odd, guessed(0.1, 0.1)); }).find("pose"),
            std::string::npos);
}

}  // namespace
}  // namespace active_matching_slam
