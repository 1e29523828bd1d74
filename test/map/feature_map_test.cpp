#include "active_matching_slam/map/feature_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>

#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// A camera at the origin that looks along z, and features that it first saw from anywhere.
class World {
 public:
  World() : camera(makeSimulatedCalibration(320, 240, "none")), filter(FilterOptions()) {
    filter.reset(CameraState(), 1e-6 * Eigen::Matrix<double, 12, 12>::Identity());
  }

  FeatureId add(const Vector3d& position, const Isometry3d& first_camera = Isometry3d::Identity(),
                bool known = false) {
    MapFeature feature;
    feature.id = filter.addPointFeature(position, 1e-6 * Eigen::Matrix3d::Identity());
    feature.known = known;
    feature.patch.image = cv::Mat(31, 31, CV_8UC1, cv::Scalar(128));
    feature.patch.center = Vector2d(15, 15);
    feature.patch.pixel =
        camera.project(first_camera.inverse() * position).value_or(Vector2d(160, 120));
    feature.patch.T_world_camera = first_camera;
    map.add(feature);
    return feature.id;
  }
  std::vector<FeatureId> visible(double border_px = 8.0) const {
    std::vector<FeatureId> ids;
    for (const auto& v : map.visible(filter, camera, options, border_px)) ids.push_back(v.id);
    return ids;
  }
  bool isVisible(FeatureId id) const {
    const auto ids = visible();
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  }

  CameraModel camera;
  Ekf filter;
  FeatureMap map;
  MapOptions options;
};

Isometry3d cameraAt(const Vector3d& position, double yaw_rad = 0.0) {
  Isometry3d T_world_camera(Eigen::AngleAxisd(yaw_rad, Vector3d::UnitY()));
  T_world_camera.translation() = position;
  return T_world_camera;
}

/// A camera that looks at (0, 0, 2) from the same distance, `angle_rad` to the side.
Isometry3d cameraBeside(double angle_rad) {
  return cameraAt({-2.0 * std::sin(angle_rad), 0.0, 2.0 - 2.0 * std::cos(angle_rad)}, angle_rad);
}

VisibleFeature visibleAt(FeatureId id, double u, double v) {
  VisibleFeature feature;
  feature.id = id;
  feature.view.pixel = Vector2d(u, v);
  return feature;
}

MapFeature plainFeature(FeatureId id, double rate = 1.0, bool known = false) {
  MapFeature feature;
  feature.id = id;
  feature.recent_rate = rate;
  feature.known = known;
  return feature;
}

/// `matched` of `searched` features with ids from 0 on.
std::vector<SearchRecord> searches(int matched, int searched) {
  std::vector<SearchRecord> records;
  for (int i = 0; i < searched; ++i) records.push_back({i, i < matched});
  return records;
}

TEST(FeatureMap, SeesWhatIsAhead) {
  World world;
  const FeatureId ahead = world.add({0, 0, 2}), aside = world.add({0.8, 0.3, 2});
  EXPECT_EQ(world.visible(), (std::vector<FeatureId>{ahead, aside}));
  const auto seen = world.map.visible(world.filter, world.camera, world.options, 8.0);
  EXPECT_LT((seen[1].view.pixel - *world.camera.project(Vector3d(0.8, 0.3, 2))).norm(), 1e-9);
  EXPECT_NEAR(seen[1].view.scale, 1.0, 1e-9);
}

TEST(FeatureMap, DoesNotSeeBehindOrOutside) {
  World world;
  EXPECT_FALSE(world.isVisible(world.add({0, 0, -2}, cameraAt({0, 0, 0}, M_PI))));
  EXPECT_FALSE(world.isVisible(world.add({5, 0, 2}, cameraAt({4, 0, 0}))));
  EXPECT_FALSE(world.isVisible(world.add({0, -5, 2}, cameraAt({0, -4, 0}))));
}

TEST(FeatureMap, KeepsFromTheImageBorder) {
  World world;
  const auto& c = world.camera.calibration();
  // Five pixels inside the right border.
  const Vector3d position((c.width - 6 - c.cx) / c.fx * 2.0, 0, 2);
  world.add(position);
  EXPECT_EQ(world.visible(4.0).size(), 1u);
  EXPECT_EQ(world.visible(6.0).size(), 0u);
}

TEST(FeatureMap, DoesNotSeeWhatHasTurnedTooFar) {
  World world;
  for (const double degrees : {0.0, 30.0, 55.0, 59.0})
    EXPECT_TRUE(world.isVisible(world.add({0, 0, 2}, cameraBeside(degrees * M_PI / 180))))
        << degrees;
  for (const double degrees : {61.0, 75.0, 120.0, 180.0})
    EXPECT_FALSE(world.isVisible(world.add({0, 0, 2}, cameraBeside(degrees * M_PI / 180))))
        << degrees;
}

TEST(FeatureMap, DoesNotSeeWhatHasGrownOrShrunkTooMuch) {
  World world;
  // Distance at first sight / 2 m now is the change of size.
  for (const double scale : {0.55, 0.8, 1.0, 1.9})
    EXPECT_TRUE(world.isVisible(world.add({0, 0, 2}, cameraAt({0, 0, 2.0 - 2.0 * scale}))))
        << scale;
  for (const double scale : {0.1, 0.45, 2.1, 5.0})
    EXPECT_FALSE(world.isVisible(world.add({0, 0, 2}, cameraAt({0, 0, 2.0 - 2.0 * scale}))))
        << scale;
}

TEST(FeatureMap, DoesNotSeeWhatTheFilterNoLongerHolds) {
  World world;
  const FeatureId gone = world.add({0, 0, 2}), stays = world.add({0.1, 0, 2});
  world.filter.removeFeatures({gone});
  EXPECT_EQ(world.visible(), std::vector<FeatureId>{stays});
}

TEST(FeatureMap, KeepsFeaturesInOrderAndCountsTheRetired) {
  FeatureMap map;
  for (const FeatureId id : {5, 1, 3}) map.add(plainFeature(id));
  ASSERT_EQ(map.size(), 3);
  EXPECT_EQ(map.features()[0].id, 1);
  EXPECT_EQ(map.features()[2].id, 5);
  EXPECT_EQ(map.find(3)->id, 3);
  EXPECT_EQ(map.find(2), nullptr);
  map.retire({3, 77});
  EXPECT_EQ(map.size(), 2);
  EXPECT_EQ(map.find(3), nullptr);
  EXPECT_EQ(map.retiredTotal(), 1);
  map.clear();
  EXPECT_EQ(map.size(), 0);
  EXPECT_EQ(map.retiredTotal(), 1);
}

TEST(FeatureMap, WhatIsTakenOutGoesOnElsewhereAndIsNotCountedAsRetired) {
  World world;
  std::vector<FeatureId> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(world.add(Vector3d(0.1 * i, 0, 2)));
  const auto taken = world.map.take({ids[3], ids[1], 99});
  ASSERT_EQ(taken.size(), 2u);
  EXPECT_EQ(taken[0].id, ids[1]);
  EXPECT_EQ(taken[1].id, ids[3]);
  EXPECT_FALSE(taken[0].patch.image.empty());
  EXPECT_EQ(world.map.size(), 3);
  EXPECT_EQ(world.map.find(ids[3]), nullptr);
  EXPECT_EQ(world.map.retiredTotal(), 0);
  for (const MapFeature& feature : taken) world.map.add(feature);
  EXPECT_NE(world.map.find(ids[3]), nullptr);
}

TEST(FeatureMap, SeesTheSameInAnotherScale) {
  World world;
  world.add({0, 0, 2}, cameraBeside(0.8));
  world.add({0.5, 0.2, 3}, cameraAt({0.3, 0, 1}));
  const auto before = world.map.visible(world.filter, world.camera, world.options, 8.0);
  world.filter.rescale(7.0);
  world.map.rescale(7.0);
  const auto after = world.map.visible(world.filter, world.camera, world.options, 8.0);
  ASSERT_EQ(before.size(), 2u);
  ASSERT_EQ(after.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_LT((after[i].view.pixel - before[i].view.pixel).norm(), 1e-9);
    EXPECT_TRUE(after[i].view.affine.isApprox(before[i].view.affine, 1e-9));
  }
}

TEST(FeatureMap, ChoosesAllWhenTheyAreFew) {
  World world;
  for (int i = 0; i < 5; ++i) world.map.add(plainFeature(i));
  std::vector<VisibleFeature> visible;
  for (int i = 0; i < 5; ++i) visible.push_back(visibleAt(i, 30 + i, 30));
  EXPECT_EQ(world.map.choose(visible, world.camera, 5).size(), 5u);
}

TEST(FeatureMap, SpreadsItsChoiceOverTheImage) {
  World world;
  std::vector<VisibleFeature> visible;
  FeatureId id = 0;
  // A crowd of reliable features in one corner and one unreliable in each of nine other places.
  for (int i = 0; i < 50; ++i, ++id) {
    world.map.add(plainFeature(id, 1.0));
    visible.push_back(visibleAt(id, 5 + i % 7, 5 + i / 7));
  }
  const FeatureId first_single = id;
  for (int i = 0; i < 9; ++i, ++id) {
    world.map.add(plainFeature(id, 0.3));
    visible.push_back(visibleAt(id, 100 + 80 * (i % 3), 70 + 70 * (i / 3)));
  }
  const auto chosen = world.map.choose(visible, world.camera, 12);
  EXPECT_EQ(chosen.size(), 12u);
  EXPECT_EQ(std::count_if(chosen.begin(), chosen.end(),
                          [&](const VisibleFeature& v) { return v.id >= first_single; }),
            9);
  EXPECT_TRUE(
      std::is_sorted(chosen.begin(), chosen.end(),
                     [](const VisibleFeature& a, const VisibleFeature& b) { return a.id < b.id; }));
}

TEST(FeatureMap, PrefersTheBetterRecordAmongNeighbours) {
  World world;
  std::vector<VisibleFeature> visible;
  for (int i = 0; i < 10; ++i) {
    world.map.add(plainFeature(i, 0.05 * ((7 * i) % 10)));
    visible.push_back(visibleAt(i, 100 + i, 100));
  }
  std::set<FeatureId> best;
  for (const auto& v : world.map.choose(visible, world.camera, 3)) best.insert(v.id);
  EXPECT_EQ(best, (std::set<FeatureId>{7, 4, 1})) << "rates 9, 8 and 7 twentieths";
}

TEST(FeatureMap, AlwaysChoosesTheKnown) {
  World world;
  std::vector<VisibleFeature> visible;
  for (int i = 0; i < 20; ++i) {
    world.map.add(plainFeature(i, i < 16 ? 1.0 : 0.0, i >= 16));
    visible.push_back(visibleAt(i, 50 + i, 50));
  }
  const auto chosen = world.map.choose(visible, world.camera, 6);
  EXPECT_EQ(chosen.size(), 6u);
  for (FeatureId known = 16; known < 20; ++known)
    EXPECT_TRUE(std::any_of(chosen.begin(), chosen.end(),
                            [&](const VisibleFeature& v) { return v.id == known; }));
}

TEST(FeatureMap, ChoosesFromPredictionsOnTheImageBorderToo) {
  World world;
  std::vector<VisibleFeature> visible;
  const double corners[][2] = {{0, 0},     {319, 0},       {0, 239},
                               {319, 239}, {319.4, 239.4}, {-0.4, -0.4}};
  for (int i = 0; i < 6; ++i) {
    world.map.add(plainFeature(i));
    visible.push_back(visibleAt(i, corners[i][0], corners[i][1]));
  }
  EXPECT_EQ(world.map.choose(visible, world.camera, 4).size(), 4u);
}

TEST(FeatureMap, RecordsHowSearchesFared) {
  FeatureMap map;
  for (int i = 0; i < 6; ++i) map.add(plainFeature(i));
  map.record(searches(4, 5), 42);
  EXPECT_EQ(map.find(0)->attempts, 1);
  EXPECT_EQ(map.find(0)->successes, 1);
  EXPECT_EQ(map.find(0)->last_matched_frame, 42);
  EXPECT_DOUBLE_EQ(map.find(0)->recent_rate, 1.0);
  EXPECT_EQ(map.find(4)->attempts, 1);
  EXPECT_EQ(map.find(4)->successes, 0);
  EXPECT_NE(map.find(4)->last_matched_frame, 42);
  EXPECT_LT(map.find(4)->recent_rate, 1.0);
  EXPECT_EQ(map.find(5)->attempts, 0) << "was not searched";
  map.record({{99, true}}, 43);  // retired meanwhile
  EXPECT_EQ(map.size(), 6);
}

TEST(FeatureMap, RecentRateFollowsTheLastSearches) {
  FeatureMap map;
  for (int i = 0; i < 4; ++i) map.add(plainFeature(i));
  for (int frame = 0; frame < 30; ++frame) map.record(searches(3, 4), frame);
  EXPECT_GT(map.find(0)->recent_rate, 0.99);
  EXPECT_LT(map.find(3)->recent_rate, 0.05);
  for (int frame = 0; frame < 30; ++frame) map.record(searches(4, 4), frame);
  EXPECT_GT(map.find(3)->recent_rate, 0.95);
  EXPECT_EQ(map.find(3)->attempts, 60);
  EXPECT_EQ(map.find(3)->successes, 30);
}

TEST(FeatureMap, BlamesTheImageWhenNearlyNothingMatches) {
  FeatureMap map;
  for (int i = 0; i < 10; ++i) map.add(plainFeature(i));
  map.record(searches(3, 10), 1);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(map.find(i)->attempts, i < 3 ? 1 : 0) << i;
  map.record(searches(4, 10), 2);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(map.find(i)->attempts, i < 3 ? 2 : 1) << i;
}

TEST(FeatureMap, ExpectsAsManyMatchesAsTheRecordSays) {
  FeatureMap map;
  map.add(plainFeature(1, 1.0));
  map.add(plainFeature(2, 0.5));
  map.add(plainFeature(3, 0.25));
  EXPECT_DOUBLE_EQ(map.expectedMatches({visibleAt(1, 0, 0), visibleAt(3, 0, 0)}), 1.25);
  EXPECT_DOUBLE_EQ(map.expectedMatches({}), 0.0);
}

TEST(FeatureMap, NamesThoseThatFailTooOften) {
  const MapOptions options;  // ten attempts, half of them
  const auto with = [](FeatureId id, int attempts, int successes, double rate, bool known = false) {
    MapFeature feature = plainFeature(id, rate, known);
    feature.attempts = attempts;
    feature.successes = successes;
    return feature;
  };
  FeatureMap map;
  map.add(with(0, 9, 0, 0.1));          // too early to say
  map.add(with(1, 10, 4, 0.8));         // fails over its life
  map.add(with(2, 10, 5, 0.8));         // just holds
  map.add(with(3, 1000, 900, 0.2));     // was good, fails now
  map.add(with(4, 1000, 900, 0.3));     // fails at times
  map.add(with(5, 100, 0, 0.0, true));  // known
  EXPECT_EQ(map.failing(options), (std::vector<FeatureId>{1, 3}));
}

TEST(FeatureMap, SparesFeaturesWhoseImagesFailTogether) {
  FeatureMap map;
  for (int i = 0; i < 10; ++i) map.add(plainFeature(i));
  for (int frame = 0; frame < 50; ++frame) map.record(searches(0, 10), frame);
  EXPECT_TRUE(map.failing(MapOptions()).empty());
}

/// Matches of 12 features over `frames`: all follow a common error of the prediction, the first
/// `wander` pixels a match more.
void watch(World* world, std::vector<FeatureId>* ids, int frames, double wander) {
  for (int i = 0; i < 12; ++i) ids->push_back(world->add(Vector3d(0.1 * i - 0.5, 0.0, 2.0)));
  for (int frame = 0; frame < frames; ++frame) {
    std::vector<SearchRecord> searches;
    for (int i = 0; i < 12; ++i) {
      const double noise = 0.1 * ((7 * i + 5 * frame) % 11 - 5) / 5.0;
      searches.push_back({(*ids)[i], true, 1, 50, Vector2d(1.5 + noise, i == 0 ? wander : noise)});
    }
    world->map.record(searches, frame);
  }
}

TEST(FeatureMap, NamesThoseWhoseMatchesLeaveThePredictionAlwaysToOneSide) {
  World world;
  std::vector<FeatureId> ids;
  watch(&world, &ids, 30, 0.8);
  EXPECT_EQ(world.map.drifting(), std::vector<FeatureId>{ids[0]});
}

TEST(FeatureMap, ACommonErrorOfThePredictionIsNoDrift) {
  World world;
  std::vector<FeatureId> ids;
  watch(&world, &ids, 30, 0.0);
  EXPECT_TRUE(world.map.drifting().empty());
}

TEST(FeatureMap, AFewMatchesAreNoDriftYet) {
  World world;
  std::vector<FeatureId> ids;
  watch(&world, &ids, 5, 3.0);
  EXPECT_TRUE(world.map.drifting().empty());
}

TEST(FeatureMap, MovesFirstViewsByTheImageTheyWereTakenIn) {
  World world;
  const FeatureId id = world.add(Vector3d(0, 0, 2));
  world.map.movePatches([](std::int64_t image, const Isometry3d& T_world_camera) {
    return Isometry3d(T_world_camera * Eigen::Translation3d(static_cast<double>(image), 2, 3));
  });
  EXPECT_TRUE(world.map.find(id)->patch.T_world_camera.translation().isApprox(Vector3d(0, 2, 3)));
}

TEST(FeatureMap, ThoseThatToldLeastOfTheCameraLeaveFirst) {
  World world;
  const FeatureId often = world.add({0, 0, 2}), seldom = world.add({0.1, 0, 2}),
                  gone = world.add({0, 0, -2});
  world.add({0.2, 0, 2}, Isometry3d::Identity(), true);
  EXPECT_TRUE(world.map.leastInformative(3).empty()) << "nothing is known of them yet";
  world.map.recordInformation({{often, {}}, {seldom, {}}, {gone, {}}}, {2.0, 1.0, 9.0}, {}, 0.1);
  EXPECT_EQ(world.map.leastInformative(1), std::vector<FeatureId>{seldom});
  for (int frame = 0; frame < 200; ++frame)
    world.map.recordInformation({{often, {}}, {seldom, {}}}, {2.0, 1.0}, {}, 0.1);
  EXPECT_EQ(world.map.leastInformative(9), (std::vector<FeatureId>{gone, seldom, often}))
      << "what was out of view for long goes first, and a known one never";
  EXPECT_TRUE(world.map.leastInformative(-1).empty());
  for (int frame = 0; frame < 200; ++frame)
    world.map.recordInformation({{seldom, {}}}, {1.0}, {often}, 0.1);
  EXPECT_EQ(world.map.leastInformative(9), (std::vector<FeatureId>{gone, seldom}))
      << "nothing is known of what is behind a mask";
  world.map.recordInformation({{seldom, {}}}, {1.0}, {}, 0.1);
  EXPECT_EQ(world.map.leastInformative(9).back(), often) << "it was not forgotten there";
}

TEST(FeatureMap, LeavesFirstWhatIsFurthestFromTheView) {
  World world;
  const FeatureId ahead = world.add({0, 0, 2});
  const FeatureId behind = world.add({0, 0, -2});
  const FeatureId beside = world.add({2, 0, 0.1});
  EXPECT_EQ(world.map.leastUseful(world.filter, 3),
            (std::vector<FeatureId>{behind, beside, ahead}));
  EXPECT_EQ(world.map.leastUseful(world.filter, 1), std::vector<FeatureId>{behind});
  EXPECT_TRUE(world.map.leastUseful(world.filter, 0).empty());
  EXPECT_TRUE(world.map.leastUseful(world.filter, -3).empty());
  EXPECT_EQ(world.map.leastUseful(world.filter, 10).size(), 3u);
}

TEST(FeatureMap, CountsAFarFirstViewByTheDepth) {
  World world;
  const FeatureId near = world.add({0, 0, 1}, cameraAt({0.8, 0, 0}));
  const FeatureId far = world.add({0, 0, 10}, cameraAt({0.8, 0, 0}));
  EXPECT_EQ(world.map.leastUseful(world.filter, 2), (std::vector<FeatureId>{near, far}));
}

TEST(FeatureMap, LeavesSoonerWhatIsNotMatched) {
  World world;
  const FeatureId good = world.add({0.1, 0, 2});
  const FeatureId bad = world.add({0, 0, 2});
  for (int frame = 0; frame < 10; ++frame) world.map.record({{good, true}, {bad, false}}, frame);
  EXPECT_EQ(world.map.leastUseful(world.filter, 1), std::vector<FeatureId>{bad});
}

TEST(FeatureMap, NeverGivesUpTheKnown) {
  World world;
  const FeatureId known = world.add({0, 0, -2}, Isometry3d::Identity(), true);
  const FeatureId other = world.add({0, 0, 2});
  EXPECT_EQ(world.map.leastUseful(world.filter, 5), std::vector<FeatureId>{other});
  for (int frame = 0; frame < 100; ++frame)
    world.map.record({{known, false}, {other, true}}, frame);
  EXPECT_TRUE(world.map.failing(world.options).empty());
}

TEST(MapOptions, MustAllowAsManyFeaturesAsAreMeasured) {
  MapOptions options;
  EXPECT_NO_THROW(checkMapOptions(options));
  options.maximum_features = options.features_per_frame;
  EXPECT_NO_THROW(checkMapOptions(options));
  options.maximum_features = options.features_per_frame - 1;
  try {
    checkMapOptions(options);
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("map/maximum_features"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace active_matching_slam
