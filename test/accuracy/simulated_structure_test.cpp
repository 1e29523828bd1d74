// The structure found while tracking rendered scenes of which the right answer is known.

#include <gtest/gtest.h>

#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/information/submap_partition.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

std::shared_ptr<const TrackedFrame> lastFrameOf(const std::string& scene, const std::string& motion,
                                                std::uint64_t seed) {
  SimulatorOptions simulation;
  simulation.scene = scene;
  simulation.motion = motion;
  simulation.seed = seed;
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = 10.0;
  Simulator simulator(simulation);
  TrackerOptions options;
  options.structure = true;
  Tracker tracker(simulator.camera(), options);
  std::shared_ptr<const TrackedFrame> last;
  while (const auto image = simulator.next()) last = tracker.track(image->image, image->stamp_s);
  return last;
}

/// Features of each submap, [on the table, on the wall and the floor before it].
std::map<int, std::pair<int, int>> depthsOf(const TrackedFrame& frame,
                                            const SubmapPartition& partition) {
  // The table is at most 1.6 m off, wall and floor 4 m and more; the unit of the map, free as it
  // is, is the median depth at the start.
  constexpr double kBetween = 2.5;
  std::map<FeatureId, double> depth;
  for (const TrackedFeature& feature : frame.features)
    depth[feature.id] = (frame.camera.poseWorldCamera().inverse() * feature.position_world).z();
  std::map<int, std::pair<int, int>> counts;
  for (std::size_t i = 0; i < partition.submap_of_feature.size(); ++i) {
    auto& [near, far] = counts[partition.submap_of_feature[i]];
    ++(depth.at(frame.submaps->ids[i]) < kBetween ? near : far);
  }
  return counts;
}

TEST(TwoDepths, TheTableInFrontComesApartFromTheWallBehind) {
  const std::vector<std::pair<const char*, int>> runs = {{"slow", 1}, {"slow", 2}, {"sideways", 1}};
  double margin = 0.0;  // mean over the runs
  for (const auto& [motion, seed] : runs) {
    SCOPED_TRACE(std::string(motion) + ", seed " + std::to_string(seed));
    const auto frame = lastFrameOf("two_depths", motion, static_cast<std::uint64_t>(seed));
    ASSERT_TRUE(frame->submaps);
    const SubmapPartition two = partitionIntoSubmaps(*frame->graph, *frame->submaps, 2);
    ASSERT_EQ(two.submaps, 2);
    for (const auto& [submap, count] : depthsOf(*frame, two)) {
      EXPECT_GE(count.first + count.second, 10) << "submap " << submap;
      EXPECT_LE(6 * std::min(count.first, count.second), count.first + count.second)
          << "submap " << submap;
    }
    const int features = static_cast<int>(two.submap_of_feature.size());
    const double naive =
        preservedInformation(graphEdges(*frame->graph), naivePartition(features, 2), 2);
    std::printf("two_depths, %s, seed %d: preserved %.3f, naive %.3f\n", motion, seed,
                two.preserved, naive);
    EXPECT_GT(two.preserved, naive);
    margin += (two.preserved - naive) / static_cast<double>(runs.size());
  }
  EXPECT_GT(margin, 0.1);
}

class RenderedStructure : public testing::TestWithParam<std::tuple<const char*, const char*>> {};

TEST_P(RenderedStructure, SubmapsPreserveMoreThanNaivePartsAtEveryLevel) {
  const auto [scene, motion] = GetParam();
  const auto frame = lastFrameOf(scene, motion, 1);
  ASSERT_TRUE(frame->submaps);
  int intermediate = 0;
  for (const SubmapLevel& level : frame->submaps->levels) {
    if (level.submaps == 1 || level.submaps == static_cast<int>(frame->submaps->ids.size()))
      continue;
    ++intermediate;
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive) << level.submaps << " submaps";
  }
  EXPECT_GE(intermediate, 2);
}

INSTANTIATE_TEST_SUITE_P(Scenes, RenderedStructure,
                         testing::Values(std::make_tuple("two_depths", "slow"),
                                         std::make_tuple("corridor", "forward"),
                                         std::make_tuple("room", "slow")));

}  // namespace
}  // namespace active_matching_slam
