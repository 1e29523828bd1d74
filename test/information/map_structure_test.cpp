#include "active_matching_slam/information/map_structure.h"

#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>
#include <vector>

#include "information/random_gaussian.h"

namespace active_matching_slam {
namespace {

TEST(MapStructure, SnapshotsAreTheGraphItsTreeAndItsHierarchy) {
  MapStructure structure;
  EXPECT_TRUE(structure.snapshot().graph->ids.empty());
  EXPECT_EQ(structure.snapshot().submaps->levels.size(), 1u);
  structure.addFrame({3, 1, 2, 7}, test::randomMeasurementCovariance(4, 1));
  structure.addFrame({3, 9, 1}, test::randomMeasurementCovariance(3, 2));
  const MapStructure::Snapshot snapshot = structure.snapshot();
  EXPECT_EQ(snapshot.graph->ids, (std::vector<std::int64_t>{1, 2, 3, 7, 9}));
  EXPECT_EQ(snapshot.graph->links.size(), 8u);
  int in_tree = 0;
  for (const InformationLink& link : snapshot.graph->links) in_tree += link.in_tree;
  EXPECT_EQ(in_tree, 4);
  EXPECT_EQ(snapshot.submaps->levels.back().submaps, 1);

  structure.forgetWeakest({1, 9, 7}, 0);
  EXPECT_EQ(structure.snapshot().submaps->ids, (std::vector<std::int64_t>{1, 7, 9}));
  EXPECT_EQ(snapshot.graph->ids.size(), 5u);  // what was handed out stays as it was

  MapStructure restored;
  restored.restore(*snapshot.graph);
  EXPECT_EQ(restored.snapshot().graph->ids, snapshot.graph->ids);
  EXPECT_THROW(restored.restore({{2, 1}, {}}), std::invalid_argument);
  EXPECT_EQ(restored.snapshot().graph->ids, snapshot.graph->ids);
  structure.clear();
  EXPECT_TRUE(structure.snapshot().graph->ids.empty());
}

TEST(MapStructure, AveragesBeginAnewWithTheNextFrameAndLabelsGoOn) {
  const Eigen::MatrixXd before = test::randomMeasurementCovariance(12, 1),
                        after = test::randomMeasurementCovariance(12, 2);
  std::vector<std::int64_t> ids(12);
  std::iota(ids.begin(), ids.end(), 0);
  MapStructure structure, only_after;
  structure.addFrame(ids, before);
  structure.snapshot();
  structure.restartAverages();
  EXPECT_EQ(structure.snapshot().graph->links.size(), 66u);  // until there is something new
  structure.addFrame(ids, after);
  only_after.addFrame(ids, after);
  const MapStructure::Snapshot is = structure.snapshot(), plain = only_after.snapshot();
  ASSERT_EQ(is.graph->links.size(), plain.graph->links.size());
  for (std::size_t i = 0; i < is.graph->links.size(); ++i) {
    EXPECT_EQ(is.graph->links[i].information_bits, plain.graph->links[i].information_bits);
    EXPECT_EQ(is.graph->links[i].frames, 1);
  }
  structure.addFrame(ids, before);
  EXPECT_EQ(structure.snapshot().graph->links.front().frames, 2);
}

}  // namespace
}  // namespace active_matching_slam
