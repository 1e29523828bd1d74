#include "active_matching_slam/information/submap_cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "information/random_graph.h"

namespace active_matching_slam {
namespace {

using test::randomGraph;

struct Structure : test::GraphStructure {
  using GraphStructure::GraphStructure;

  SubmapPartition cut(int submaps) const { return cutIntoSubmaps(graph, hierarchy, submaps); }

  /// Of the tree without the links of these indices.
  std::vector<int> labelsWithout(const std::set<std::size_t>& cuts) const {
    DisjointSets sets(static_cast<int>(hierarchy.ids.size()));
    for (std::size_t m = 0; m < hierarchy.merges.size(); ++m)
      if (cuts.count(m) == 0) sets.unite(hierarchy.merges[m].first, hierarchy.merges[m].second);
    return sets.labels();
  }

  std::set<std::size_t> cutsOf(const SubmapPartition& partition) const {
    std::set<std::size_t> cuts;
    for (std::size_t m = 0; m < hierarchy.merges.size(); ++m)
      if (partition.submap_of_feature[hierarchy.merges[m].first] !=
          partition.submap_of_feature[hierarchy.merges[m].second])
        cuts.insert(m);
    return cuts;
  }

  double preserved(const std::vector<int>& labels) const {
    return preservedInformation(graphEdges(graph), labels,
                                *std::max_element(labels.begin(), labels.end()) + 1);
  }
};

int smallest(const std::vector<int>& labels) {
  std::vector<int> size(*std::max_element(labels.begin(), labels.end()) + 1, 0);
  for (int label : labels) ++size[label];
  return *std::min_element(size.begin(), size.end());
}

/// Groups of so many features each, faint links between them.
MutualInformationGraph groups(const std::vector<int>& sizes, double faint, unsigned seed) {
  MutualInformationGraph graph;
  std::vector<int> group_of;
  for (std::size_t g = 0; g < sizes.size(); ++g) group_of.insert(group_of.end(), sizes[g], g);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> noise(0.5, 1.0);
  for (int i = 0; i < static_cast<int>(group_of.size()); ++i) {
    graph.ids.push_back(i);
    for (int k = i + 1; k < static_cast<int>(group_of.size()); ++k)
      graph.links.push_back(
          {i, k, (group_of[i] == group_of[k] ? 2.0 : faint) * noise(generator), 1, false});
  }
  return graph;
}

TEST(SubmapCut, HasAsManySubmapsAsAskedForEachAPieceOfTheTree) {
  const Structure s(randomGraph(40, 1));
  for (int submaps = 1; submaps <= 40; ++submaps) {
    const SubmapPartition partition = s.cut(submaps);
    EXPECT_EQ(partition.submaps, submaps);
    EXPECT_DOUBLE_EQ(partition.preserved, s.preserved(partition.submap_of_feature));
    EXPECT_EQ(s.cutsOf(partition).size(), static_cast<std::size_t>(submaps - 1));
    EXPECT_EQ(s.labelsWithout(s.cutsOf(partition)), partition.submap_of_feature);
  }
}

TEST(SubmapCut, NoOtherLinkWouldBeBetterCutInPlaceOfOne) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const Structure s(randomGraph(30, seed, seed % 2 ? 1.0 : 0.4, seed < 6 ? 1000000 : 5));
    for (int submaps : {2, 3, 5, 8}) {
      const SubmapPartition partition = s.cut(submaps);
      const double least = std::min(30.0 / (3.0 * submaps - 2.0),
                                    static_cast<double>(smallest(partition.submap_of_feature)));
      const std::set<std::size_t> cuts = s.cutsOf(partition);
      for (std::size_t out : cuts) {
        for (std::size_t in = 0; in < s.hierarchy.merges.size(); ++in) {
          std::set<std::size_t> other = cuts;
          other.erase(out);
          if (!other.insert(in).second) continue;
          const std::vector<int> labels = s.labelsWithout(other);
          if (smallest(labels) < least) continue;
          EXPECT_LE(s.preserved(labels), partition.preserved + 1e-8);
        }
      }
    }
  }
}

TEST(SubmapCut, TwoSubmapsAreTheBestOfAllCuts) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const Structure s(groups({12, 20}, 0.4, seed));
    double best = 0.0;
    for (std::size_t m = 0; m < s.hierarchy.merges.size(); ++m) {
      const std::vector<int> labels = s.labelsWithout({m});
      if (smallest(labels) >= 8) best = std::max(best, s.preserved(labels));
    }
    ASSERT_GT(best, 0.5);
    EXPECT_DOUBLE_EQ(s.cut(2).preserved, best);
  }
}

TEST(SubmapCut, FindsGroups) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const Structure s(groups({14, 9, 17, 10}, 0.04, seed));
    const SubmapPartition four = s.cut(4);
    for (int i = 0; i < 50; ++i)
      EXPECT_EQ(four.submap_of_feature[i], i < 14 ? 0 : i < 23 ? 1 : i < 40 ? 2 : 3);
  }
}

// What is far takes its strongest link to what is near in the same round in which the near features
// come together in two halves: merged in that order, one half goes with the far.
TEST(SubmapCut, AnEarlyLinkDoesNotBind) {
  constexpr int kFeatures = 24, kFirstFar = 16;
  const auto bitsBetween = [](int i, int k) {  // of features i < k
    if (i >= kFirstFar || i / 4 == k / 4) return k == i + 1 ? 4.0 : 3.0;
    if (k >= kFirstFar) return 0.1;
    return i / 8 == k / 8 ? 2.0 : 1.0;
  };
  MutualInformationGraph graph;
  for (int i = 0; i < kFeatures; ++i) {
    graph.ids.push_back(i);
    for (int k = i + 1; k < kFeatures; ++k)
      graph.links.push_back({i, k, bitsBetween(i, k) + 1e-4 * (i + k), 1, false});
  }
  const Structure s(graph);
  const SubmapPartition two = s.cut(2), merged = partitionIntoSubmaps(s.graph, s.hierarchy, 2);
  EXPECT_NE(merged.submap_of_feature[0], merged.submap_of_feature[kFirstFar - 1]);
  EXPECT_GT(two.preserved, merged.preserved);
  for (int i = 0; i < kFeatures; ++i)
    EXPECT_EQ(two.submap_of_feature[i], i < kFirstFar ? 0 : 1) << i;
}

TEST(SubmapCut, GivesTheNumberAskedForWhetherTheGraphIsConnectedOrNot) {
  const Structure s(randomGraph(30, 2, 0.05));
  const int parts = s.hierarchy.levels.back().submaps;
  ASSERT_GT(parts, 2);
  for (int submaps = 1; submaps <= 30; ++submaps) EXPECT_EQ(s.cut(submaps).submaps, submaps);
  EXPECT_EQ(s.cut(1000).submaps, 30);
  EXPECT_EQ(Structure(randomGraph(0, 0)).cut(3).submaps, 0);
}

/// Two rings without a link between them, the second with ids from 100 on.
MutualInformationGraph twoRings(int first, int second) {
  MutualInformationGraph graph;
  const auto addRing = [&graph](int from, int features) {
    for (int i = 0; i < features; ++i) {
      graph.ids.push_back(from + i);
      if (i + 1 < features)
        graph.links.push_back({from + i, from + i + 1, 1.0 + 0.01 * i, 1, false});
      if (i == 0) graph.links.push_back({from, from + features - 1, 0.5, 1, false});
    }
  };
  addRing(0, first);
  addRing(100, second);
  return graph;
}

TEST(SubmapCut, PartsThatAreNotConnectedComeApartFirstAndLoseNothing) {
  const SubmapPartition two = Structure(twoRings(12, 9)).cut(2);
  EXPECT_EQ(two.preserved, 1.0);
  for (int i = 0; i < 21; ++i) EXPECT_EQ(two.submap_of_feature[i], i < 12 ? 0 : 1) << i;
}

TEST(SubmapCut, AFeatureWithoutLinksIsNoSubmapButGoesWithItsNeighboursInTime) {
  MutualInformationGraph graph = twoRings(12, 9);
  graph.ids.insert(graph.ids.begin() + 12, {20, 95});  // next to the one and to the other
  const SubmapPartition two = Structure(graph).cut(2);
  EXPECT_EQ(two.preserved, 1.0);
  for (int i = 0; i < 23; ++i) EXPECT_EQ(two.submap_of_feature[i], i < 13 ? 0 : 1) << i;
}

TEST(SubmapCut, SaysWhatIsWrong) {
  const Structure s(randomGraph(4, 0)), other(randomGraph(5, 0));
  EXPECT_THROW(s.cut(0), std::invalid_argument);
  EXPECT_THROW(cutIntoSubmaps(other.graph, s.hierarchy, 2), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
