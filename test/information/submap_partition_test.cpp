#include "active_matching_slam/information/submap_partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "information/random_graph.h"

namespace active_matching_slam {
namespace {

using test::randomGraph;

TEST(SubmapPartition, HasAsManySubmapsAsAskedForAndContainsTheLevels) {
  const test::GraphStructure s(randomGraph(40, 1));
  for (int submaps = 1; submaps <= 40; ++submaps) {
    const SubmapPartition partition = partitionIntoSubmaps(s.graph, s.hierarchy, submaps);
    EXPECT_EQ(partition.submaps, submaps);
    EXPECT_DOUBLE_EQ(
        partition.preserved,
        preservedInformation(graphEdges(s.graph), partition.submap_of_feature, submaps));
  }
  for (const SubmapLevel& level : s.hierarchy.levels) {
    const SubmapPartition partition = partitionIntoSubmaps(s.graph, s.hierarchy, level.submaps);
    EXPECT_EQ(partition.submap_of_feature, level.submap_of_feature);
  }
}

TEST(SubmapPartition, ComesAsNearToTheNumberAsTheGraphAllows) {
  const test::GraphStructure s(randomGraph(30, 2, 0.05));
  const int parts = s.hierarchy.levels.back().submaps;
  ASSERT_GT(parts, 1);
  EXPECT_EQ(partitionIntoSubmaps(s.graph, s.hierarchy, 1).submaps, parts);
  EXPECT_EQ(partitionIntoSubmaps(s.graph, s.hierarchy, 1000).submaps, 30);
}

TEST(SubmapPartition, PreservesTheFractionWithTheMostSubmaps) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const test::GraphStructure s(randomGraph(40, seed, seed % 2 ? 1.0 : 0.2));
    for (double fraction : {0.0, 0.3, 0.5, 0.7, 0.9, 1.0}) {
      const SubmapPartition partition = partitionPreserving(s.graph, s.hierarchy, fraction);
      EXPECT_GE(partition.preserved, fraction);
      for (int more = partition.submaps + 1; more <= s.hierarchy.levels[1].submaps; ++more) {
        EXPECT_LT(partitionIntoSubmaps(s.graph, s.hierarchy, more).preserved, fraction);
      }
      EXPECT_LE(partition.submaps, s.hierarchy.levels[1].submaps);
    }
  }
}

TEST(SubmapPartition, LimitsTheSizeAndNoTreeLinkCouldStillJoinTwoSubmaps) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const test::GraphStructure s(randomGraph(40, seed, seed % 2 ? 1.0 : 0.1));
    for (int limit : {1, 2, 3, 7, 20, 40, 100}) {
      const SubmapPartition partition = partitionLimitingSize(s.graph, s.hierarchy, limit);
      std::vector<int> size(partition.submaps, 0);
      for (int label : partition.submap_of_feature) ++size[label];
      EXPECT_LE(*std::max_element(size.begin(), size.end()), limit);
      for (const SubmapMerge& merge : s.hierarchy.merges) {
        const int a = partition.submap_of_feature[merge.first];
        const int b = partition.submap_of_feature[merge.second];
        EXPECT_TRUE(a == b || size[a] + size[b] > limit);
      }
    }
  }
}

TEST(SubmapPartition, OfNothingIsNothing) {
  const test::GraphStructure s(randomGraph(0, 0));
  EXPECT_EQ(partitionIntoSubmaps(s.graph, s.hierarchy, 3).submaps, 0);
  EXPECT_EQ(partitionPreserving(s.graph, s.hierarchy, 0.5).submaps, 0);
  EXPECT_EQ(partitionLimitingSize(s.graph, s.hierarchy, 3).submaps, 0);
}

TEST(SubmapPartition, SaysWhatIsWrong) {
  const test::GraphStructure s(randomGraph(4, 0)), other(randomGraph(5, 0));
  EXPECT_THROW(partitionIntoSubmaps(s.graph, s.hierarchy, 0), std::invalid_argument);
  EXPECT_THROW(partitionPreserving(s.graph, s.hierarchy, 1.1), std::invalid_argument);
  EXPECT_THROW(partitionPreserving(s.graph, s.hierarchy, -0.1), std::invalid_argument);
  EXPECT_THROW(partitionLimitingSize(s.graph, s.hierarchy, 0), std::invalid_argument);
  EXPECT_THROW(partitionIntoSubmaps(other.graph, s.hierarchy, 2), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
