// That tracking yields the structure of the map. How good it is, test/information/ asks.

#include <gtest/gtest.h>

#include <memory>

#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

TEST(LiveStructure, IsAGraphAndAHierarchyOfItsFeatures) {
  SimulatorOptions simulation;
  simulation.scene = "two_depths";
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = 2.0;
  Simulator simulator(simulation);
  TrackerOptions options;
  options.structure = true;
  Tracker tracker(simulator.camera(), options);
  std::shared_ptr<const TrackedFrame> last;
  while (const auto image = simulator.next()) last = tracker.track(image->image, image->stamp_s);

  ASSERT_TRUE(last->graph);
  ASSERT_TRUE(last->submaps);
  EXPECT_EQ(last->graph->ids, last->submaps->ids);
  EXPECT_GE(last->graph->ids.size(), 10u);
  EXPECT_GE(last->graph->links.size(), last->graph->ids.size());
  ASSERT_GE(last->submaps->levels.size(), 2u);
  const SubmapLevel& finest = last->submaps->levels.front();
  EXPECT_EQ(finest.submaps, static_cast<int>(last->graph->ids.size()));
  EXPECT_LT(last->submaps->levels.back().submaps, finest.submaps);
}

}  // namespace
}  // namespace active_matching_slam
