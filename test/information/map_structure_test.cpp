#include "active_matching_slam/information/map_structure.h"

#include <gtest/gtest.h>

#include <stdexcept>

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

  structure.keepOnly({1, 9, 7});
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

}  // namespace
}  // namespace active_matching_slam
