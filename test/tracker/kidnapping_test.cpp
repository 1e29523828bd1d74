// A camera that is carried off and put down elsewhere: lost, and found again in the same map.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

constexpr int kCarriedOff = 90;  ///< frame of the film before which the camera is taken away
constexpr int kElsewhere = 40;   ///< frames in between

/// Frames of another place, with the stamps that follow frame kCarriedOff - 1 of the film.
const Film& elsewhere() {
  static const Film film = [] {
    SimulatorOptions options = filmOptions(2.0);
    options.scene = "office";
    options.seed = 5;
    Film other = makeFilm(options);
    for (std::size_t i = 0; i < other.frames.size(); ++i)
      other.frames[i].stamp_s = slowFilm().frames[kCarriedOff - 1].stamp_s + double(i + 1) / 30.0;
    return other;
  }();
  return film;
}

/// The slow film with its second part put off by the time elsewhere.
Film putOff(Film film, double by_s) {
  for (std::size_t i = kCarriedOff; i < film.frames.size(); ++i) film.frames[i].stamp_s += by_s;
  return film;
}

std::set<FeatureId> idsOf(const TrackedFrame& frame) {
  std::set<FeatureId> ids;
  for (const TrackedFeature& feature : frame.features) ids.insert(feature.id);
  return ids;
}

double sigmaPosition(const TrackedFrame& frame) {
  return std::sqrt(frame.camera_covariance.topLeftCorner<3, 3>().trace());
}

/// First frame that is tracked again; the number of frames when there is none.
int firstTracked(const Frames& frames) {
  const auto it = std::find_if(frames.begin(), frames.end(), [](const auto& frame) {
    return frame->state == TrackingState::kTracking;
  });
  return static_cast<int>(it - frames.begin());
}

/// The scale and the frame of the world are those of before: one similarity fits both parts.
void expectOnePath(const Film& film, Frames before, const Frames& after, int first_after) {
  Film joined{film.camera, {}};
  joined.frames.assign(film.frames.begin(), film.frames.begin() + std::ptrdiff_t(before.size()));
  joined.frames.insert(joined.frames.end(), film.frames.begin() + first_after, film.frames.end());
  before.insert(before.end(), after.begin(), after.end());
  const PathFit fit = fitPath(joined, before);
  EXPECT_LT(fit.rms_m, 0.1 * fit.path_m);
}

TEST(Kidnapping, TheCameraIsLostElsewhereAndFoundAtHomeInTheSameMap) {
  const Film film = putOff(slowFilm(), kElsewhere / 30.0);
  Tracker tracker(film.camera, {});
  const Frames before = trackFrames(film, &tracker, 0, kCarriedOff);
  const auto known = idsOf(*before.back());

  const Frames away = trackFrames(elsewhere(), &tracker, 0, kElsewhere);
  const int allowed = tracker.options().lost_after_frames;
  for (int i = allowed; i < kElsewhere; ++i) {
    EXPECT_EQ(away[i]->state, TrackingState::kLost) << "frame " << i << " elsewhere";
    EXPECT_NE(away[i]->reason, "");
    EXPECT_TRUE(isFinite(*away[i]));
    if (i > allowed) {
      EXPECT_GT(sigmaPosition(*away[i]), sigmaPosition(*away[i - 1])) << "frame " << i;
    }
  }
  EXPECT_EQ(away.back()->times_lost, 1);

  const Frames after = trackFrames(film, &tracker, kCarriedOff, 180);
  const int found = firstTracked(after);
  ASSERT_LT(found, 15);
  for (std::size_t i = found; i < after.size(); ++i) {
    EXPECT_EQ(after[i]->state, TrackingState::kTracking) << "frame " << i << " at home";
    EXPECT_TRUE(isFinite(*after[i]));
  }
  EXPECT_EQ(after.back()->resets, 0);
  std::vector<FeatureId> kept;
  const auto known_now = idsOf(*after[found]);
  std::set_intersection(known.begin(), known.end(), known_now.begin(), known_now.end(),
                        std::back_inserter(kept));
  EXPECT_GT(2 * kept.size(), known.size()) << "the map is the one of before";
  expectOnePath(film, before, Frames(after.begin() + found, after.end()), kCarriedOff + found);
}

/// Frames [0, count) of another place, from `first_stamp_s` on.
Film farAway(int count, double first_stamp_s) {
  SimulatorOptions options = filmOptions(count / 30.0 + 0.1);
  options.scene = "office";
  options.seed = 5;
  Film other = makeFilm(options);
  for (std::size_t i = 0; i < other.frames.size(); ++i)
    other.frames[i].stamp_s = first_stamp_s + double(i) / 30.0;
  return other;
}

TEST(Kidnapping, ANewMapIsBegunElsewhereWithinASecondAndTheOldOneFoundOnTheSide) {
  constexpr int kAway = 110;
  const Film film = putOff(slowFilm(), kAway / 30.0);
  Tracker tracker(film.camera, {});
  const Frames before = trackFrames(film, &tracker, 0, kCarriedOff);
  EXPECT_EQ(before.back()->map, 0);
  EXPECT_EQ(before.back()->jumps, 0);

  const Film other = farAway(kAway, film.frames[kCarriedOff - 1].stamp_s + 1.0 / 30.0);
  const Frames away = trackFrames(other, &tracker, 0, kAway);
  const int lost = tracker.options().lost_after_frames;
  const int begun = firstTracked(Frames(away.begin() + lost, away.end())) + lost;
  EXPECT_LE(begun, lost + static_cast<int>(1.1 * 30.0)) << "within a second after the loss";
  for (int i = lost; i < begun; ++i) EXPECT_EQ(away[i]->state, TrackingState::kLost) << i;
  for (int i = begun; i < kAway; ++i) {
    EXPECT_EQ(away[i]->state, TrackingState::kTracking) << i;
    EXPECT_EQ(away[i]->map, 1) << i;
    EXPECT_TRUE(isFinite(*away[i]));
  }
  EXPECT_NE(away[begun]->reason.find("map 1 begun"), std::string::npos) << away[begun]->reason;
  EXPECT_EQ(away[begun]->jumps, 1);

  const Frames after = trackFrames(film, &tracker, kCarriedOff, 180);
  const auto home =
      std::find_if(after.begin(), after.end(), [](const auto& frame) { return frame->map == 0; });
  const auto found = static_cast<int>(home - after.begin());
  ASSERT_LT(found, 30) << "within a second after it came back";
  EXPECT_EQ(after[found]->jumps, 2);
  for (std::size_t i = found; i < after.size(); ++i) {
    EXPECT_EQ(after[i]->state, TrackingState::kTracking) << i;
    EXPECT_EQ(after[i]->map, 0) << i;
  }
  EXPECT_EQ(after.back()->resets, 0);
  expectOnePath(film, before, Frames(after.begin() + found, after.end()), kCarriedOff + found);
}

TEST(Kidnapping, WithoutNewMapsTheCameraStaysLost) {
  TrackerOptions options;
  options.new_map_when_lost_after_s = 0.0;
  constexpr int kAway = 80;
  const Film film = putOff(slowFilm(), kAway / 30.0);
  Tracker tracker(film.camera, options);
  trackFrames(film, &tracker, 0, kCarriedOff);
  const Film other = farAway(kAway, film.frames[kCarriedOff - 1].stamp_s + 1.0 / 30.0);
  const Frames away = trackFrames(other, &tracker, 0, kAway);
  for (int i = options.lost_after_frames; i < kAway; ++i)
    EXPECT_EQ(away[i]->state, TrackingState::kLost) << i;
  EXPECT_EQ(away.back()->map, 0);
}

TEST(Kidnapping, NoNewMapIsBegunInTheDark) {
  constexpr int kDark = 80;
  Film film = putOff(slowFilm(), kDark / 30.0);
  Tracker tracker(film.camera, {});
  trackFrames(film, &tracker, 0, kCarriedOff);
  const double begin_s = film.frames[kCarriedOff - 1].stamp_s;
  for (int i = 1; i <= kDark; ++i) {
    cv::Mat dark(240, 320, CV_8UC1, cv::Scalar(0));
    dark.at<std::uint8_t>(100, 100 + i) = 10;
    const auto frame = tracker.track(dark, begin_s + i / 30.0);
    EXPECT_EQ(frame->map, 0);
    if (i > tracker.options().lost_after_frames) EXPECT_EQ(frame->state, TrackingState::kLost) << i;
  }
  const Frames after = trackFrames(film, &tracker, kCarriedOff, 180);
  EXPECT_LT(firstTracked(after), 15);
  EXPECT_EQ(after.back()->map, 0);
}

TEST(Kidnapping, ACutToAnotherPartOfTheFilmIsFollowed) {
  // From the end of the film back to its beginning, and the stamps go on.
  Film film = slowFilm();
  const double end_s = film.frames.back().stamp_s;
  std::vector<SimulatedFrame> again(film.frames.begin(), film.frames.begin() + 120);
  for (SimulatedFrame& frame : again) frame.stamp_s += end_s;
  film.frames.insert(film.frames.end(), again.begin(), again.end());
  Tracker tracker(film.camera, {});
  const Frames before = trackFrames(film, &tracker, 0, 180);
  const Frames after = trackFrames(film, &tracker, 180, 300);
  for (const auto& frame : after) EXPECT_TRUE(isFinite(*frame));
  EXPECT_EQ(after.back()->state, TrackingState::kTracking);
  EXPECT_EQ(after.back()->resets, 0);
  expectOnePath(film, before, Frames(after.begin() + 60, after.end()), 240);
}

TEST(Kidnapping, APauseOfTheCameraIsBridged) {
  for (const double pause_s : {0.5, 3.0, 600.0}) {
    const Film film = putOff(slowFilm(), pause_s);
    Tracker tracker(film.camera, {});
    const Frames before = trackFrames(film, &tracker, 0, kCarriedOff);
    const Frames after = trackFrames(film, &tracker, kCarriedOff, 180);
    const int found = firstTracked(after);
    ASSERT_LT(found, 10) << pause_s << " s";
    EXPECT_EQ(after.back()->state, TrackingState::kTracking) << pause_s << " s";
    EXPECT_EQ(after.back()->resets, 0) << pause_s << " s";
    expectOnePath(film, before, Frames(after.begin() + found, after.end()), kCarriedOff + found);
  }
}

TEST(Kidnapping, TheTrackerStartsAnewAfterTheTimeItIsGiven) {
  TrackerOptions options;
  options.reset_when_lost_after_s = 0.4;
  const Film film = putOff(slowFilm(), kElsewhere / 30.0);
  Tracker tracker(film.camera, options);
  trackFrames(film, &tracker, 0, kCarriedOff);
  const Frames away = trackFrames(elsewhere(), &tracker, 0, kElsewhere);
  int resets_seen = 0;
  for (std::size_t i = 1; i < away.size(); ++i) {
    if (away[i]->resets == away[i - 1]->resets) continue;
    ++resets_seen;
    EXPECT_NE(away[i]->reason.find("started anew"), std::string::npos) << away[i]->reason;
    EXPECT_NEAR(double(i), options.lost_after_frames + 0.4 * 30.0, 2.0);
  }
  EXPECT_EQ(resets_seen, 1);
  EXPECT_EQ(away.back()->state, TrackingState::kTracking) << "in a map of the new place";
}

TEST(Kidnapping, AMapThatCannotBeFoundAgainIsGivenUpAtOnce) {
  Film film = slowFilm();
  Tracker tracker(film.camera, {});
  const int allowed = tracker.options().lost_after_frames;
  constexpr int kFirst = 3;  // images that belong together, without depth yet
  for (int i = kFirst; i <= kFirst + allowed; ++i) {  // dark, and none repeats the one before
    film.frames[i].image = cv::Mat(240, 320, CV_8UC1, cv::Scalar(0));
    film.frames[i].image.at<std::uint8_t>(100, 100 + i) = 10;
  }
  const Frames frames = trackFrames(film, &tracker, 0, kFirst + allowed + 11);
  EXPECT_EQ(frames[kFirst + allowed - 1]->state, TrackingState::kLost) << "no depth is known yet";
  EXPECT_EQ(frames[kFirst + allowed]->resets, 1);
  EXPECT_NE(frames[kFirst + allowed]->reason.find("depth"), std::string::npos);
  EXPECT_EQ(frames.back()->state, TrackingState::kTracking) << "in a new map";
}

/// Frames until the camera is found at home, where matching, and so a look, has `milliseconds` of
/// each frame. The camera moves meanwhile.
int framesUntilFound(double milliseconds) {
  static const Film large = makeFilm(filmOptions(6.0, {640, 480}));
  const Film film = putOff(large, kElsewhere / 30.0);
  TrackerOptions options;
  options.matching.max_milliseconds = milliseconds;
  Tracker tracker(film.camera, options);
  const Frames before = trackFrames(film, &tracker, 0, kCarriedOff);
  const double begin_s = film.frames[kCarriedOff - 1].stamp_s;
  for (int i = 0; i < kElsewhere; ++i) {  // dark, and none repeats the one before
    cv::Mat dark(480, 640, CV_8UC1, cv::Scalar(0));
    dark.at<std::uint8_t>(100, 100 + i) = 10;
    tracker.track(dark, begin_s + (i + 1) / 30.0);
  }
  const Frames after = trackFrames(film, &tracker, kCarriedOff, 180);
  const int found = firstTracked(after);
  if (found < static_cast<int>(after.size())) {
    EXPECT_EQ(after.back()->state, TrackingState::kTracking);
    EXPECT_EQ(after.back()->map, 0);
    expectOnePath(film, before, Frames(after.begin() + found, after.end()), kCarriedOff + found);
  }
  return found;
}

TEST(Kidnapping, ALookTakesSomeFramesAndTheCameraIsFoundWhereItHasGoneMeanwhile) {
  const int at_once = framesUntilFound(0.0), in_steps = framesUntilFound(20.0);
  std::cout << "found after " << at_once << " frames without, " << in_steps
            << " with a bound of their time\n";
  EXPECT_LT(at_once, in_steps);
  EXPECT_LT(in_steps, 45);
}

TEST(Kidnapping, TwoMapsOfARoomAreJoinedWhenOneIsRecognisedFromTheOther) {
  // One side of the view, the dark, the other side, and then all of it.
  constexpr int kSide = 60, kDark = 20, kOtherSide = 70, kAll = 90;
  const Film film = makeFilm(filmOptions((kSide + kDark + kOtherSide + kAll + 1) / 30.0));
  const auto side = [](int left) {
    cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(0));
    mask.colRange(left, left + 120).setTo(255);
    return mask;
  };
  TrackerOptions options;
  options.new_map_when_lost_after_s = 0.1;
  Tracker tracker(film.camera, options);
  tracker.setMask(side(200));
  const Frames before = trackFrames(film, &tracker, 0, kSide);
  EXPECT_EQ(before.back()->state, TrackingState::kTracking);
  for (int i = kSide; i < kSide + kDark; ++i) {
    cv::Mat dark(240, 320, CV_8UC1, cv::Scalar(0));
    dark.at<std::uint8_t>(100, i) = 10;
    tracker.track(dark, film.frames[i].stamp_s);
  }
  tracker.setMask(side(0));
  const int other = kSide + kDark, all = other + kOtherSide;
  const Frames beside = trackFrames(film, &tracker, other, all);
  ASSERT_EQ(beside.back()->state, TrackingState::kTracking);
  ASSERT_EQ(beside.back()->map, 1) << "nothing of the first map is in view";
  tracker.setMask(cv::Mat());
  const Frames after = trackFrames(film, &tracker, all, all + kAll);
  const auto joined =
      std::find_if(after.begin(), after.end(), [](const auto& frame) { return frame->map == 0; });
  ASSERT_NE(joined, after.end());
  const TrackedFrame& at = **joined;
  const TrackedFrame& one_before = joined == after.begin() ? *beside.back() : **(joined - 1);
  EXPECT_NE(at.reason.find("map 1 joined with map 0"), std::string::npos) << at.reason;
  EXPECT_EQ(at.map_epoch, one_before.map_epoch + 1);
  EXPECT_EQ(at.jumps, one_before.jumps + 1);
  EXPECT_TRUE((at.map_jump * one_before.camera.poseWorldCamera()).matrix().allFinite());
  EXPECT_GT(at.features.size(), before.back()->features.size()) << "it holds what both held";
  for (auto frame = joined; frame != after.end(); ++frame) {
    EXPECT_EQ((*frame)->state, TrackingState::kTracking);
    EXPECT_EQ((*frame)->map, 0);
    EXPECT_TRUE(isFinite(**frame));
  }
  // Features of the other map are matched, at once and with those of the first.
  const auto next = joined + 3;
  ASSERT_LT(next, after.end());
  int matched_left = 0, matched_right = 0;
  for (const TrackedFeature& feature : (*next)->features)
    if (feature.status == FeatureStatus::kMatched)
      ++(feature.matched_px.x() < 160.0 ? matched_left : matched_right);
  EXPECT_GE(matched_left, 10);
  EXPECT_GE(matched_right, 10);
  const auto first = static_cast<int>(joined - after.begin());
  expectOnePath(film, before, Frames(joined, after.end()), all + first);
}

/// A map file that is removed at the end.
class SavedMap : public testing::Test {
 protected:
  void SetUp() override {
    path_ = testing::TempDir() + "/kidnapping_test_" + std::to_string(::getpid()) + ".map";
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::string path_;
};

TEST_F(SavedMap, ANewTrackerFindsTheCameraInIt) {
  const Film& film = slowFilm();
  Tracker first(film.camera, {}), second(film.camera, {});
  const Frames before = trackFrames(film, &first, 0, kCarriedOff);
  first.setScale(2.0);
  first.saveMap(path_);
  second.loadMap(path_);
  const Frames after = trackFrames(film, &second, kCarriedOff, 180);
  const int found = firstTracked(after);
  ASSERT_LT(found, 10);
  EXPECT_EQ(after.back()->state, TrackingState::kTracking);
  EXPECT_EQ(after.back()->scale_source, ScaleSource::kService);
  Frames scaled;
  for (const auto& frame : before) {
    auto copy = std::make_shared<TrackedFrame>(*frame);
    copy->camera.position_world *= 2.0;
    scaled.push_back(copy);
  }
  expectOnePath(film, scaled, Frames(after.begin() + found, after.end()), kCarriedOff + found);
}

TEST_F(SavedMap, OfAnotherCameraOrDamagedIsRefusedAndChangesNothing) {
  const Film& film = slowFilm();
  Tracker tracker(film.camera, {}), undisturbed(film.camera, {});
  trackFrames(film, &undisturbed, 0, 30);
  trackFrames(film, &tracker, 0, 30);
  EXPECT_THROW(tracker.loadMap(path_), std::runtime_error) << "there is none";
  tracker.saveMap(path_);
  CameraCalibration other = film.camera.calibration();
  other.fx += 1.0;
  Tracker of_another_camera(CameraModel(other), TrackerOptions{});
  EXPECT_THROW(of_another_camera.loadMap(path_), std::runtime_error);
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) / 2);
  EXPECT_THROW(tracker.loadMap(path_), std::runtime_error) << "truncated";
  std::ofstream(path_) << "image_width: 640\n";
  EXPECT_THROW(tracker.loadMap(path_), std::runtime_error) << "foreign";
  const Frames a = trackFrames(film, &tracker, 30, 40), b = trackFrames(film, &undisturbed, 30, 40);
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(sameState(*a[i], *b[i])) << "frame " << i;
}

}  // namespace
}  // namespace active_matching_slam
