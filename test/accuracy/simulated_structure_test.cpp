// The structure found while tracking rendered scenes of which the right answer is known.

#include <gtest/gtest.h>

#include <cstdio>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/information/submap_partition.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

struct StructureRun {
  std::string scene, motion;
  std::uint64_t seed = 1;
};

std::ostream& operator<<(std::ostream& out, const StructureRun& run) {
  return out << run.scene << ", " << run.motion << ", seed " << run.seed;
}

struct RenderedSequence {
  CameraModel camera;
  std::vector<SimulatedFrame> images;
};

RenderedSequence render(const StructureRun& run) {
  SimulatorOptions simulation;
  simulation.scene = run.scene;
  simulation.motion = run.motion;
  simulation.seed = run.seed;
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = 10.0;
  Simulator simulator(simulation);
  RenderedSequence sequence{simulator.camera(), {}};
  while (auto image = simulator.next()) sequence.images.push_back(std::move(*image));
  return sequence;
}

enum class Unit { kFree, kMetric };

/// With a metric unit the first two seconds tell the scale: from then on the map is metric, as the
/// thesis's maps are, so that depths and the noise of the motion are what they say.
std::shared_ptr<const TrackedFrame> lastFrameOf(const RenderedSequence& sequence,
                                                TrackerOptions options, Unit unit) {
  constexpr int kFramesToScale = 60;
  options.structure = true;
  Tracker tracker(sequence.camera, options);
  std::shared_ptr<const TrackedFrame> last;
  for (const SimulatedFrame& image : sequence.images) {
    last = tracker.track(image.image, image.stamp_s);
    if (unit == Unit::kFree || image.index != kFramesToScale) continue;
    const Eigen::Isometry3d T_start_camera =
        sequence.images.front().truth.T_world_camera.inverse() * image.truth.T_world_camera;
    tracker.setScale(T_start_camera.translation().norm() / last->camera.position_world.norm());
  }
  return last;
}

/// Features of each submap, [on the table, on the wall and the floor before it].
std::map<int, std::pair<int, int>> depthsOf(const TrackedFrame& frame,
                                            const SubmapPartition& partition) {
  constexpr double kBetween_m = 2.0;  // the table is at most 1 m off, wall and floor 4 m and more
  std::map<FeatureId, double> depth;
  for (const TrackedFeature& feature : frame.features)
    depth[feature.id] = (frame.camera.poseWorldCamera().inverse() * feature.position_world).z();
  std::map<int, std::pair<int, int>> counts;
  for (std::size_t i = 0; i < partition.submap_of_feature.size(); ++i) {
    const auto at = depth.find(frame.submaps->ids[i]);
    if (at == depth.end()) continue;  // left the map since the submaps were made
    auto& [near, far] = counts[partition.submap_of_feature[i]];
    ++(at->second < kBetween_m ? near : far);
  }
  return counts;
}

double naivePreserved(const TrackedFrame& frame, int submaps) {
  const int features = static_cast<int>(frame.submaps->ids.size());
  return preservedInformation(graphEdges(*frame.graph), naivePartition(features, submaps), submaps);
}

const std::vector<StructureRun>& twoDepthsRuns() {
  static const std::vector<StructureRun> runs = {{"two_depths", "circle", 1},
                                                 {"two_depths", "slow", 1},
                                                 {"two_depths", "slow", 2},
                                                 {"two_depths", "sideways", 1}};
  return runs;
}

/// Cuts the map in two and expects table and wall to come apart, but for every tenth feature.
/// Returns by how much more is preserved than by the naive halves.
double expectTwoDepths(const StructureRun& run, const TrackedFrame& frame) {
  const SubmapPartition two = partitionIntoSubmaps(*frame.graph, *frame.submaps, 2);
  const double naive = naivePreserved(frame, 2);
  std::printf("%s: preserved %.3f, naive %.3f;", testing::PrintToString(run).c_str(), two.preserved,
              naive);
  EXPECT_EQ(two.submaps, 2);
  for (const auto& [submap, count] : depthsOf(frame, two)) {
    std::printf(" %d near and %d far", count.first, count.second);
    EXPECT_GE(count.first + count.second, 10) << "submap " << submap;
    EXPECT_LE(10 * std::min(count.first, count.second), count.first + count.second)
        << "submap " << submap;
  }
  std::printf("\n");
  return two.preserved - naive;
}

// A turn of the camera moves near and far alike. So how much the two share is first of all a
// matter of how much turning the filter allows for, against shifting.
TEST(TwoDepths, TheTableInFrontComesApartFromTheWallBehind) {
  TrackerOptions shifting;  // 8 rad/s^2 and more seen from the table, which is half a metre off
  shifting.filter.sigma_acceleration_mps2 = 4.0;
  shifting.filter.sigma_angular_acceleration_rps2 = 3.0;
  double margin_by_default = 0.0;  // mean over the runs
  for (const StructureRun& run : twoDepthsRuns()) {
    SCOPED_TRACE(testing::PrintToString(run));
    const RenderedSequence sequence = render(run);
    const auto shifted = lastFrameOf(sequence, shifting, Unit::kMetric);
    const auto usual = lastFrameOf(sequence, TrackerOptions(), Unit::kMetric);
    ASSERT_TRUE(shifted->submaps);
    ASSERT_TRUE(usual->submaps);
    // Table 6.1, two submaps: 84.5 % against 50.8 %.
    EXPECT_GT(expectTwoDepths(run, *shifted), 0.845 - 0.508);
    const double by_default = expectTwoDepths(run, *usual);
    EXPECT_GT(by_default, 0.2);
    margin_by_default += by_default / static_cast<double>(twoDepthsRuns().size());
  }
  EXPECT_GT(margin_by_default, 0.25);
}

class RenderedStructure : public testing::TestWithParam<StructureRun> {};

TEST_P(RenderedStructure, SubmapsPreserveMoreThanNaivePartsAtEveryLevel) {
  const auto frame = lastFrameOf(render(GetParam()), TrackerOptions(), Unit::kFree);
  ASSERT_TRUE(frame->submaps);
  const std::string name = testing::PrintToString(GetParam());
  int intermediate = 0;
  for (const SubmapLevel& level : frame->submaps->levels) {
    if (level.submaps == 1 || level.submaps == static_cast<int>(frame->submaps->ids.size()))
      continue;
    ++intermediate;
    std::printf("%s: %d submaps: preserved %.3f, naive %.3f\n", name.c_str(), level.submaps,
                level.preserved_chow_liu, level.preserved_naive);
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive) << level.submaps << " submaps";
  }
  EXPECT_GE(intermediate, 2);
}

INSTANTIATE_TEST_SUITE_P(Scenes, RenderedStructure,
                         testing::Values(StructureRun{"two_depths", "slow", 1},
                                         StructureRun{"corridor", "forward", 1},
                                         StructureRun{"wall", "sideways", 1},
                                         StructureRun{"room", "slow", 1}));

// Table 6.1, sideways, four submaps: 93.8 % against 74.7 %. The margins of its finer partitions
// (ten submaps: 0.24) and of its forward sequence (three and 18 submaps: 0.11) are not met here.
TEST(LongWallStructure, SectionsPreserveMoreThanNaivePartsByTheMarginOfTheThesis) {
  const auto frame = lastFrameOf(render({"wall", "sideways", 1}), TrackerOptions(), Unit::kMetric);
  ASSERT_TRUE(frame->submaps);
  const SubmapPartition four = partitionIntoSubmaps(*frame->graph, *frame->submaps, 4);
  const SubmapPartition ten = partitionIntoSubmaps(*frame->graph, *frame->submaps, 10);
  const double naive_four = naivePreserved(*frame, 4), naive_ten = naivePreserved(*frame, 10);
  std::printf("wall, sideways: 4 submaps: preserved %.3f, naive %.3f; 10: %.3f, %.3f\n",
              four.preserved, naive_four, ten.preserved, naive_ten);
  EXPECT_GT(four.preserved, naive_four + 0.938 - 0.747);
  EXPECT_GT(ten.preserved, naive_ten + 0.1);
}

}  // namespace
}  // namespace active_matching_slam
