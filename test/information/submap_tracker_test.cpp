#include "active_matching_slam/information/submap_tracker.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "information/random_graph.h"

namespace active_matching_slam {
namespace {

SubmapHierarchy oneLevel(const std::vector<std::int64_t>& ids, const std::vector<int>& labels) {
  SubmapHierarchy hierarchy;
  hierarchy.ids = ids;
  hierarchy.levels.resize(1);
  hierarchy.levels[0].submap_of_feature = labels;
  hierarchy.levels[0].submaps =
      static_cast<int>(std::set<int>(labels.begin(), labels.end()).size());
  return hierarchy;
}

/// Labels after `labels` of `ids` is shown to the tracker.
std::vector<int> relabelled(SubmapTracker& tracker, const std::vector<std::int64_t>& ids,
                            const std::vector<int>& labels) {
  SubmapHierarchy hierarchy = oneLevel(ids, labels);
  tracker.relabel(hierarchy);
  return hierarchy.levels[0].submap_of_feature;
}

using Labels = std::vector<int>;

TEST(SubmapTracker, TheFirstFrameKeepsItsLabels) {
  SubmapTracker tracker;
  EXPECT_EQ(relabelled(tracker, {1, 2, 3}, {0, 1, 0}), (Labels{0, 1, 0}));
}

TEST(SubmapTracker, ClustersKeepTheirLabelsWhenTheirOrderChanges) {
  SubmapTracker tracker;
  relabelled(tracker, {5, 6, 7, 8}, {0, 0, 1, 1});
  // A new lowest id joins the second cluster, which so becomes the first in order.
  EXPECT_EQ(relabelled(tracker, {1, 5, 6, 7, 8}, {0, 1, 1, 0, 0}), (Labels{1, 0, 0, 1, 1}));
}

TEST(SubmapTracker, TheLargerPartOfASplitKeepsTheLabel) {
  SubmapTracker tracker;
  relabelled(tracker, {1, 2, 3, 4, 5}, {0, 0, 0, 1, 1});
  EXPECT_EQ(relabelled(tracker, {1, 2, 3, 4, 5}, {0, 1, 1, 2, 2}), (Labels{2, 0, 0, 1, 1}));
}

TEST(SubmapTracker, AMergedClusterTakesTheLabelOfItsLargerPartTiesTheLower) {
  SubmapTracker larger, equal;
  relabelled(larger, {1, 2, 3, 4, 5}, {0, 0, 1, 1, 1});
  EXPECT_EQ(relabelled(larger, {1, 2, 3, 4, 5}, {0, 0, 0, 0, 0}), (Labels{1, 1, 1, 1, 1}));
  relabelled(equal, {1, 2, 3, 4}, {0, 0, 1, 1});
  EXPECT_EQ(relabelled(equal, {1, 2, 3, 4}, {0, 0, 0, 0}), (Labels{0, 0, 0, 0}));
}

TEST(SubmapTracker, ALabelThatJustVanishedIsNotGivenAwayAtOnce) {
  SubmapTracker tracker;
  relabelled(tracker, {1, 2, 3, 4}, {0, 0, 1, 1});
  EXPECT_EQ(relabelled(tracker, {3, 4, 8, 9}, {0, 0, 1, 1}), (Labels{1, 1, 2, 2}));
  EXPECT_EQ(relabelled(tracker, {3, 4, 10}, {0, 0, 1}), (Labels{1, 1, 0}));
}

TEST(SubmapTracker, ALevelThatWasAwayForAFrameComesBackWithItsLabels) {
  SubmapTracker tracker;
  SubmapHierarchy two = oneLevel({1, 2}, {0, 1});
  two.levels.push_back(oneLevel({1, 2}, {0, 1}).levels[0]);
  tracker.relabel(two);
  SubmapHierarchy one = oneLevel({1, 2}, {0, 1});
  tracker.relabel(one);
  SubmapHierarchy swapped = oneLevel({0, 2}, {0, 1});
  swapped.levels.push_back(oneLevel({0, 2}, {0, 1}).levels[0]);
  tracker.relabel(swapped);
  EXPECT_EQ(swapped.levels[1].submap_of_feature[1], 1);
  tracker.clear();
  SubmapHierarchy fresh = oneLevel({2}, {0});
  tracker.relabel(fresh);
  EXPECT_EQ(fresh.levels[0].submap_of_feature[0], 0);
}

TEST(SubmapTracker, RenamesButNeverChangesAPartition) {
  SubmapTracker tracker;
  for (unsigned frame = 0; frame < 30; ++frame) {
    MutualInformationGraph graph = test::randomGraph(20 + frame % 5, frame, 0.3);
    const SubmapHierarchy before = buildSubmapHierarchy(graph);
    SubmapHierarchy after = before;
    tracker.relabel(after);
    ASSERT_EQ(after.levels.size(), before.levels.size());
    for (std::size_t h = 0; h < before.levels.size(); ++h) {
      std::map<int, int> name;
      std::set<int> names;
      for (std::size_t i = 0; i < before.ids.size(); ++i) {
        const int label = after.levels[h].submap_of_feature[i];
        EXPECT_GE(label, 0);
        EXPECT_EQ(name.emplace(before.levels[h].submap_of_feature[i], label).first->second, label);
        names.insert(label);
      }
      EXPECT_EQ(static_cast<int>(names.size()), before.levels[h].submaps);
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
