// What leaves the view of a full map is laid aside in submaps, and found again.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "../../src/tracker/submap_keeper.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

TrackerOptions submapOptions() {
  TrackerOptions options;
  options.submap_filter.enabled = true;
  options.map.features_per_frame = 30;
  options.map.maximum_features = 80;
  return options;
}

/// Goes along a corridor, and the same way back.
const Film& wayFilm() {
  static const Film film = [] {
    SimulatorOptions options = filmOptions(9.0);
    options.scene = "corridor_loop";
    options.motion = "loop";
    options.rate_hz = 20.0;
    Film there = makeFilm(options);
    const double end_s = there.frames.back().stamp_s;
    for (std::size_t i = there.frames.size() - 1; i-- > 0;) {
      there.frames.push_back(there.frames[i]);
      there.frames.back().stamp_s = 2.0 * end_s - there.frames[i].stamp_s;
    }
    return there;
  }();
  return film;
}

/// A tracker that has seen the whole film, and what it said.
struct Way {
  Tracker tracker{wayFilm().camera, submapOptions()};
  Frames frames = trackFrames(wayFilm(), &tracker, 0, static_cast<int>(wayFilm().frames.size()));
};

const Way& way() {
  static const Way whole;
  return whole;
}

std::set<FeatureId> idsIn(const TrackedFrame& frame) {
  std::set<FeatureId> ids;
  for (const TrackedFeature& feature : frame.features) ids.insert(feature.id);
  return ids;
}

TEST(TrackerSubmaps, FeaturesThatWereLaidAsideAreMatchedAgain) {
  std::set<FeatureId> aside, again;
  int most_submaps = 0;
  for (const auto& frame : way().frames) {
    ASSERT_TRUE(isFinite(*frame));
    EXPECT_EQ(frame->state, TrackingState::kTracking) << frame->index;
    ASSERT_TRUE(frame->frozen);
    const FrozenMap& frozen = *frame->frozen;
    most_submaps = std::max(most_submaps, frozen.submaps);
    const std::set<FeatureId> active = idsIn(*frame);
    FeatureId last = -1;
    for (const FrozenFeature& feature : frozen.features) {
      ASSERT_GT(feature.id, last);
      last = feature.id;
      ASSERT_EQ(active.count(feature.id), 0u) << "a feature is in one place only";
      ASSERT_TRUE(feature.position_world.allFinite());
      EXPECT_LT(feature.submap, frozen.frozen);
      aside.insert(feature.id);
    }
    for (const FeatureId id : frozen.active_separators) EXPECT_EQ(active.count(id), 1u);
    EXPECT_GE(frozen.lost_bits, 0.0);
    for (const TrackedFeature& feature : frame->features)
      if (feature.status == FeatureStatus::kMatched && aside.count(feature.id) > 0)
        again.insert(feature.id);
  }
  EXPECT_GE(most_submaps, 1);
  EXPECT_GE(way().frames.back()->frozen->found, 1);
  EXPECT_GE(again.size(), 10u);
  std::cout << "laid aside " << aside.size() << ", matched again " << again.size() << "\n";
}

TEST(TrackerSubmaps, FewerFeaturesAreBegunTwice) {
  TrackerOptions without = submapOptions();
  without.submap_filter.enabled = false;
  Tracker tracker(wayFilm().camera, without);
  const Frames frames =
      trackFrames(wayFilm(), &tracker, 0, static_cast<int>(wayFilm().frames.size()));
  const auto started = [](const Frames& run) {
    int sum = 0;
    for (const auto& frame : run) sum += frame->features_started;
    return sum;
  };
  EXPECT_FALSE(frames.back()->frozen);
  std::cout << "begun " << started(way().frames) << ", without submaps " << started(frames) << "\n";
  EXPECT_LT(started(way().frames), started(frames));
}

TEST(TrackerSubmaps, TheMapIsAsAccurateAsOneOfWhichNothingIsLost) {
  const PathFit fit = fitPath(wayFilm(), way().frames);
  TrackerOptions large = submapOptions();
  large.submap_filter.enabled = false;
  large.map.maximum_features = 400;
  Tracker tracker(wayFilm().camera, large);
  const PathFit whole = fitPath(
      wayFilm(), trackFrames(wayFilm(), &tracker, 0, static_cast<int>(wayFilm().frames.size())));
  std::cout << "rms " << fit.rms_m << " m, of one large map " << whole.rms_m << " m\n";
  EXPECT_LT(fit.rms_m, 1.5 * whole.rms_m);
}

std::string contentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(TrackerSubmaps, AreSavedAndLoadedBitForBit) {
  const std::string path =
      testing::TempDir() + "/submaps_test_" + std::to_string(::getpid()) + ".map";
  way().tracker.saveMap(path);
  const std::string first = contentOf(path);
  Tracker again(wayFilm().camera, submapOptions());
  again.loadMap(path);
  again.saveMap(path);
  EXPECT_EQ(contentOf(path), first);
  const auto& frozen = *way().frames.back()->frozen;
  const int last = static_cast<int>(wayFilm().frames.size()) - 1;
  // It goes on where the film ended.
  const auto frame = again.track(wayFilm().frames[last].image, wayFilm().frames[last].stamp_s);
  ASSERT_TRUE(frame->frozen);
  EXPECT_EQ(frame->frozen->submaps, frozen.submaps);
  ASSERT_EQ(frame->frozen->features.size(), frozen.features.size());

  TrackerOptions without = submapOptions();
  without.submap_filter.enabled = false;
  Tracker plain(wayFilm().camera, without);
  plain.loadMap(path);
  const auto told = plain.track(wayFilm().frames[last].image, wayFilm().frames[last].stamp_s);
  EXPECT_FALSE(told->frozen);
  std::filesystem::remove(path);
}

/// What a tracker that has seen the film knows, and the first submap that it laid aside.
class SubmapTrial : public testing::Test {
 protected:
  SubmapTrial() {
    const std::string path =
        testing::TempDir() + "/submap_trial_" + std::to_string(::getpid()) + ".map";
    way().tracker.saveMap(path);
    content_ = readMapFile(path);
    std::filesystem::remove(path);
    filter_.restore(content_.camera_state, content_.features, content_.covariance,
                    content_.next_id);
    for (const MapFeature& feature : content_.map) map_.add(feature);
    keeper_.restore(content_);
    leaf_ = keeper_.tree().leaves().front();
    EXPECT_TRUE(keeper_.activateOnTrial(leaf_.id, kStampS, 1000, &filter_, &map_));
  }

  /// Of the submap's first ten features `matched` matched.
  std::map<FeatureId, bool> tenOfWhich(int matched) const {
    std::map<FeatureId, bool> looked_for;
    for (int k = 0; k < 10; ++k) looked_for[leaf_.points.ids[k]] = k < matched;
    return looked_for;
  }

  static constexpr double kStampS = 100.0;
  MapFileContent content_;
  Ekf filter_{FilterOptions()};
  FeatureMap map_;
  SubmapKeeper keeper_{submapOptions().submap_filter};
  Leaf leaf_;
};

TEST_F(SubmapTrial, IsOverAsSoonAsMostOfItMatch) {
  const int before = keeper_.describe(filter_)->found;
  EXPECT_TRUE(keeper_.isOnTrial(leaf_.points.ids[0]));
  keeper_.judgeTrial(tenOfWhich(5));
  EXPECT_TRUE(keeper_.hasTrial()) << "half of ten may be chance";
  keeper_.judgeTrial(tenOfWhich(6));
  EXPECT_FALSE(keeper_.hasTrial());
  EXPECT_EQ(keeper_.foundWherePredicted(), 1);
  EXPECT_EQ(keeper_.describe(filter_)->found, before + 1);
  EXPECT_NE(filter_.find(leaf_.points.ids[0]), nullptr);
  keeper_.putBack(kStampS, &filter_, &map_);  // nothing is on trial
  EXPECT_NE(filter_.find(leaf_.points.ids[0]), nullptr);
}

TEST_F(SubmapTrial, AFewMatchesAreNoProofHoweverOftenAndItIsPutBackAsItWas) {
  int images = 0;
  while (!keeper_.isTrialOver()) {
    ASSERT_LT(images++, 100);
    keeper_.judgeTrial(tenOfWhich(3));
    EXPECT_TRUE(keeper_.isOnTrial(leaf_.points.ids[0]));
  }
  EXPECT_EQ(keeper_.missedWherePredicted(), 1);
  EXPECT_EQ(keeper_.foundWherePredicted(), 0);
  keeper_.putBack(kStampS, &filter_, &map_);
  EXPECT_FALSE(keeper_.hasTrial());
  MapFileContent after;
  keeper_.save(filter_, &after);
  ASSERT_EQ(after.submaps.size(), content_.submaps.size());
  EXPECT_EQ(after.submaps[0].id, leaf_.id);
  EXPECT_EQ(after.submaps[0].points.Q, leaf_.points.Q);
  EXPECT_EQ(after.trunk.ids, content_.trunk.ids);
  ASSERT_EQ(after.frozen.size(), content_.frozen.size());
  for (std::size_t i = 0; i < after.frozen.size(); ++i) {
    EXPECT_EQ(after.frozen[i].id, content_.frozen[i].id);
    EXPECT_EQ(after.frozen[i].attempts, content_.frozen[i].attempts);
  }
  EXPECT_EQ(map_.size(), static_cast<int>(content_.map.size()));
  EXPECT_LT((filter_.covariance() - content_.covariance).norm(), 1e-9 * content_.covariance.norm());
}

TEST_F(SubmapTrial, GoesAlongWhenTheUnitOfLengthChanges) {
  filter_.rescale(2.0);
  keeper_.rescale(2.0);
  keeper_.putBack(kStampS, &filter_, &map_);
  const Eigen::VectorXd expected = 2.0 * leaf_.points.mean;
  EXPECT_LT((keeper_.tree().find(leaf_.id)->points.mean - expected).norm(), 1e-9);
}

TEST(TrackerSubmaps, TakeAnotherUnitOfLengthWithTheMap) {
  Way own;
  const auto before = own.frames.back();
  ASSERT_FALSE(before->frozen->features.empty());
  own.tracker.setScale(2.5);
  const auto after = own.tracker.track(wayFilm().frames.back().image, before->stamp_s + 0.03);
  ASSERT_EQ(after->frozen->features.size(), before->frozen->features.size());
  for (std::size_t i = 0; i < before->frozen->features.size(); ++i) {
    const Eigen::Vector3d expected = 2.5 * before->frozen->features[i].position_world;
    // The image in between has told of the map.
    EXPECT_LT((after->frozen->features[i].position_world - expected).norm(),
              0.05 * expected.norm());
  }
  own.tracker.reset("on request");
  const auto anew = own.tracker.track(wayFilm().frames.back().image, before->stamp_s + 0.06);
  EXPECT_TRUE(anew->frozen->features.empty());
  EXPECT_EQ(anew->frozen->submaps, 0);
}

TEST(TrackerSubmaps, ALostCameraIsFoundInASubmap) {
  const Film& film = wayFilm();
  Tracker tracker(film.camera, submapOptions());
  const int count = static_cast<int>(film.frames.size());
  const Frames frames = trackFrames(film, &tracker, 0, count);
  // The frame whose features that were matched are now, most of them, laid aside.
  std::set<FeatureId> aside;
  for (const FrozenFeature& feature : frames.back()->frozen->features)
    if (feature.submap >= 0) aside.insert(feature.id);
  int best = -1, most = 0;
  for (int i = 60; i < count; ++i) {
    int shown = 0;
    for (const TrackedFeature& feature : frames[i]->features)
      if (feature.status == FeatureStatus::kMatched && aside.count(feature.id) > 0) ++shown;
    if (shown > most) best = i, most = shown;
  }
  ASSERT_GE(most, 12) << "of " << aside.size();
  double stamp_s = frames.back()->stamp_s;
  const cv::Size size = film.frames[0].image.size();
  for (int i = 0;
       tracker.track(cv::Mat(size, CV_8UC1, cv::Scalar(100 + i % 2 * 20)), stamp_s += 0.033)
           ->state != TrackingState::kLost;
       ++i)
    ASSERT_LT(i, 100);
  std::shared_ptr<const TrackedFrame> found;
  for (int i = 0; i < 20; ++i) {
    found = tracker.track(film.frames[best].image, stamp_s += 0.033);
    if (found->state == TrackingState::kTracking) break;
  }
  ASSERT_EQ(found->state, TrackingState::kTracking);
  EXPECT_EQ(found->map, frames.back()->map);
  EXPECT_LT((found->camera.position_world - frames[best]->camera.position_world).norm(), 0.1);
}

}  // namespace
}  // namespace active_matching_slam
