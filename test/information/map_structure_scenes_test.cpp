// Scenes that have a right answer: what belongs together is known from how they were built.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "active_matching_slam/information/map_structure.h"
#include "active_matching_slam/information/submap_partition.h"
#include "information/covariance_world.h"

namespace active_matching_slam {
namespace {

using test::CameraPose;
using test::CovarianceWorld;
using test::Spread;
using test::WorldStructure;

/// A table close by and a wall far behind it, both in view all the time; the camera is shaken to
/// and fro before them.
CovarianceWorld tableBeforeWall(unsigned seed) {
  CovarianceWorld world;
  Spread spread(seed);
  for (int i = 0; i < 60; ++i) {
    const bool on_table = spread.below(2) == 0;
    const double z = on_table ? 0.6 + 0.1 * spread() : 15.0 + 1.5 * spread();
    world.points.push_back({{0.5 * z * spread(), 0.35 * z * spread(), z}, on_table ? 0 : 1});
  }
  world.pose_at = [](double t) {
    CameraPose pose;
    pose.position_world = {0.12 * std::sin(2.1 * t), 0.08 * std::sin(3.3 * t),
                           0.05 * std::sin(1.3 * t)};
    pose.yaw = 0.03 * std::sin(1.7 * t);
    return pose;
  };
  world.acceleration_sigma = 8.0;
  world.angular_acceleration_sigma = 1.5;
  return world;
}

/// A camera walks down a corridor and looks at the left and at the right wall in turn.
CovarianceWorld corridor(unsigned seed) {
  CovarianceWorld world;
  Spread spread(seed);
  for (int i = 0; i < 70; ++i) {
    const bool left = spread.below(2) == 0;
    world.points.push_back(
        {{left ? -1.0 : 1.0, 0.6 * spread(), 3.0 + 2.0 * spread()}, left ? 0 : 1});
  }
  world.pose_at = [](double t) {
    CameraPose pose;
    pose.position_world = {0.0, 0.0, 0.25 * t};
    pose.yaw = 0.9 * std::sin(t);
    return pose;
  };
  world.duration_s = 8.0;
  return world;
}

/// A camera passes posters on a long wall, with bare wall between them, and comes back: half of
/// each poster's features are started on the way out, half on the way back.
CovarianceWorld sidewaysWall(unsigned seed, int posters, int features_on_poster) {
  CovarianceWorld world;
  Spread spread(seed);
  const double speed = 0.8, pitch = 3.0;  // m/s, m
  const double way_out_s = ((posters - 1) * pitch + 3.0) / speed;
  for (int poster = 0; poster < posters; ++poster) {
    for (int i = 0; i < features_on_poster; ++i) {
      const Eigen::Vector3d position(pitch * poster + 0.7 * spread(), 0.6 * spread(),
                                     2.0 + 0.1 * spread());
      world.points.push_back({position, poster, spread.below(2) == 0 ? 0.0 : way_out_s});
    }
  }
  world.pose_at = [=](double t) {
    CameraPose pose;
    pose.position_world = {speed * (t < way_out_s ? t : 2.0 * way_out_s - t) - 1.5, 0.0, 0.0};
    return pose;
  };
  world.duration_s = 2.0 * way_out_s;
  return world;
}

/// Every submap holds features of one group, and every group lies in one submap.
bool separates(const WorldStructure& structure, const std::vector<int>& submap_of_feature) {
  std::map<int, int> group_of_submap;
  std::set<int> groups;
  for (std::size_t i = 0; i < submap_of_feature.size(); ++i) {
    const int group = structure.group_of_id[structure.snapshot.graph->ids[i]];
    groups.insert(group);
    if (group_of_submap.emplace(submap_of_feature[i], group).first->second != group) return false;
  }
  return group_of_submap.size() == groups.size();
}

double naivePreserved(const WorldStructure& structure, int submaps) {
  const MutualInformationGraph& graph = *structure.snapshot.graph;
  return preservedInformation(graphEdges(graph),
                              naivePartition(static_cast<int>(graph.ids.size()), submaps), submaps);
}

SubmapPartition partition(const WorldStructure& structure, int submaps) {
  return partitionIntoSubmaps(*structure.snapshot.graph, *structure.snapshot.submaps, submaps);
}

/// The hierarchy knows the right answer: the partition with `groups` submaps is it, so is a level
/// that has as many, no finer level mixes groups and no coarser one tears a group apart.
void expectSeparated(const WorldStructure& structure, int groups) {
  const SubmapPartition right = partition(structure, groups);
  EXPECT_TRUE(separates(structure, right.submap_of_feature));
  for (const SubmapLevel& level : structure.snapshot.submaps->levels) {
    EXPECT_TRUE(level.submaps != groups || separates(structure, level.submap_of_feature));
    std::set<std::pair<int, int>> meet;  // (submap of the level, right submap)
    for (std::size_t i = 0; i < level.submap_of_feature.size(); ++i) {
      meet.emplace(level.submap_of_feature[i], right.submap_of_feature[i]);
    }
    EXPECT_EQ(static_cast<int>(meet.size()), std::max(level.submaps, groups));
  }
}

bool hasLevelOf(const WorldStructure& structure, int submaps) {
  const std::vector<SubmapLevel>& levels = structure.snapshot.submaps->levels;
  return std::any_of(levels.begin(), levels.end(),
                     [&](const SubmapLevel& level) { return level.submaps == submaps; });
}

// Margins: what Table 6.1 of the thesis has between its own partition and the naive one.

TEST(MapStructureScenes, TheTableInFrontComesApartFromTheWallFarBehind) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const WorldStructure structure = test::structureOf(tableBeforeWall(seed));
    expectSeparated(structure, 2);
    EXPECT_TRUE(hasLevelOf(structure, 2));
    EXPECT_GE(partition(structure, 2).preserved, naivePreserved(structure, 2) + 0.845 - 0.508);
    EXPECT_GE(partition(structure, 7).preserved, naivePreserved(structure, 7) + 0.357 - 0.214);
  }
}

// A turn of the camera moves near and far alike: the more of it is expected, the more they share.
TEST(MapStructureScenes, ExpectedTurningHoldsTableAndWallTogether) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    CovarianceWorld world = tableBeforeWall(seed);
    const WorldStructure shifting = test::structureOf(world);
    world.angular_acceleration_sigma *= 8.0;
    const WorldStructure turning = test::structureOf(world);
    EXPECT_LT(partition(turning, 2).preserved - naivePreserved(turning, 2),
              partition(shifting, 2).preserved - naivePreserved(shifting, 2));
  }
}

TEST(MapStructureScenes, TheWallsOfACorridorComeApart) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const WorldStructure structure = test::structureOf(corridor(seed));
    expectSeparated(structure, 2);
    EXPECT_GE(partition(structure, 2).preserved, naivePreserved(structure, 2) + 0.855 - 0.745);
    EXPECT_GE(partition(structure, 3).preserved, naivePreserved(structure, 3) + 0.855 - 0.745);
  }
}

TEST(MapStructureScenes, TheSectionsOfALongWallComeApart) {
  int levels = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const WorldStructure four = test::structureOf(sidewaysWall(seed, 4, 15));
    expectSeparated(four, 4);
    EXPECT_GE(partition(four, 4).preserved, naivePreserved(four, 4) + 0.938 - 0.747);
    const WorldStructure ten = test::structureOf(sidewaysWall(seed, 10, 10));
    expectSeparated(ten, 10);
    EXPECT_GE(partition(ten, 10).preserved, naivePreserved(ten, 10) + 0.754 - 0.517);
    levels += hasLevelOf(four, 4) + hasLevelOf(ten, 10);
  }
  EXPECT_GE(levels, 1);
}

TEST(MapStructureScenes, SubmapsKeepTheirLabelsWhileTheSceneGoesOn) {
  MapStructure structure;
  std::map<std::int64_t, int> label_of_id;
  int frames = 0, changed = 0;
  test::runWorld(tableBeforeWall(2), structure, [&](const std::vector<int>&) {
    const MapStructure::Snapshot snapshot = structure.snapshot();
    for (const SubmapLevel& level : snapshot.submaps->levels) {
      if (level.submaps != 2) continue;
      ++frames;
      for (std::size_t i = 0; i < snapshot.submaps->ids.size(); ++i) {
        const int label = level.submap_of_feature[i];
        const auto [before, is_new] = label_of_id.emplace(snapshot.submaps->ids[i], label);
        if (!is_new && before->second != label) ++changed;
        before->second = label;
      }
    }
  });
  EXPECT_GT(frames, 50);
  EXPECT_EQ(changed, 0);
}

}  // namespace
}  // namespace active_matching_slam
