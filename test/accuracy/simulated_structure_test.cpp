// The structure found while tracking rendered scenes of which the right answer is known.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/information/submap_cut.h"
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

RenderedSequence render(const StructureRun& run, double duration_s = 10.0) {
  SimulatorOptions simulation;
  simulation.scene = run.scene;
  simulation.motion = run.motion;
  simulation.seed = run.seed;
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = duration_s;
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

/// One kind of features or the other; none: neither.
using KindOf = std::function<std::optional<bool>(const TrackedFeature&)>;

/// Cuts the map in two and expects two kinds of features to come apart, but for every tenth.
/// Returns by how much more is preserved than by the naive halves.
double expectToComeApart(const StructureRun& run, const TrackedFrame& frame, const KindOf& kind) {
  std::map<FeatureId, const TrackedFeature*> features;
  for (const TrackedFeature& feature : frame.features) features[feature.id] = &feature;
  const SubmapPartition two = cutIntoSubmaps(*frame.graph, *frame.submaps, 2);
  EXPECT_EQ(two.submaps, 2);
  std::map<int, std::pair<int, int>> counts;  // of the one kind and of the other, by submap
  for (std::size_t i = 0; i < two.submap_of_feature.size(); ++i) {
    const auto at = features.find(frame.submaps->ids[i]);
    if (at == features.end()) continue;  // left the map since the submaps were made
    const std::optional<bool> is_one = kind(*at->second);
    auto& [one, other] = counts[two.submap_of_feature[i]];
    if (is_one) ++(*is_one ? one : other);
  }
  const double naive = naivePreserved(frame, 2);
  std::printf("%s: preserved %.3f, naive %.3f;", testing::PrintToString(run).c_str(), two.preserved,
              naive);
  for (const auto& [submap, count] : counts) {
    std::printf(" %d and %d", count.first, count.second);
    EXPECT_GE(count.first + count.second, 10) << "submap " << submap;
    EXPECT_LE(10 * std::min(count.first, count.second), count.first + count.second)
        << "submap " << submap;
  }
  std::printf("\n");
  return two.preserved - naive;
}

/// Table, and wall with the floor before it.
KindOf byDepth(const TrackedFrame& frame) {
  constexpr double kBetween_m = 2.0;  // the table is at most 1 m off, wall and floor 4 m and more
  const Eigen::Isometry3d T_camera_world = frame.camera.poseWorldCamera().inverse();
  return [T_camera_world](const TrackedFeature& feature) {
    return (T_camera_world * feature.position_world).z() < kBetween_m;
  };
}

/// Left wall and right, not what is between: the world is that of the first camera, which stands
/// in the middle and looks along them.
KindOf bySide(const TrackedFrame& frame) {
  std::vector<double> distances;
  for (const TrackedFeature& feature : frame.features)
    distances.push_back(std::abs(feature.position_world.x()));
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double wall = *middle;
  return [wall](const TrackedFeature& feature) -> std::optional<bool> {
    const double x = feature.position_world.x();
    if (std::abs(x) < 0.5 * wall) return std::nullopt;
    return x < 0.0;
  };
}

// A turn of the camera moves near and far alike. So how much the two share is first of all a
// matter of how much turning is expected, against shifting.
TEST(TwoDepths, TheTableInFrontComesApartFromTheWallBehind) {
  TrackerOptions turning;
  turning.structure_accelerations = {7.0, 12.0};
  double margin = 0.0, margin_turning = 0.0;  // means over the runs
  for (const StructureRun& run : twoDepthsRuns()) {
    SCOPED_TRACE(testing::PrintToString(run));
    const RenderedSequence sequence = render(run);
    const auto usual = lastFrameOf(sequence, TrackerOptions(), Unit::kMetric);
    const auto turned = lastFrameOf(sequence, turning, Unit::kMetric);
    ASSERT_TRUE(usual->submaps);
    ASSERT_TRUE(turned->submaps);
    const double share = 1.0 / static_cast<double>(twoDepthsRuns().size());
    const double gained = expectToComeApart(run, *usual, byDepth(*usual));
    EXPECT_GT(gained, 0.3);
    margin += share * gained;
    margin_turning += share * expectToComeApart(run, *turned, byDepth(*turned));
  }
  // Table 6.1, two submaps: 84.5 % against 50.8 %.
  EXPECT_GT(margin, 0.845 - 0.508);
  EXPECT_GT(margin, margin_turning);
}

// The wall ahead is bare: there is nothing that is seen together with either side. Left and right
// in turns, so that the order of initialisation does not give the answer away.
TEST(CorridorStructure, TheTwoWallsComeApart) {
  double margin = 0.0;  // mean over the runs; in one of them, naive parts may happen to be good
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    const StructureRun run = {"corridor_end", "sweep", seed};
    SCOPED_TRACE(testing::PrintToString(run));
    const auto frame = lastFrameOf(render(run, 15.0), TrackerOptions(), Unit::kMetric);
    ASSERT_TRUE(frame->submaps);
    const double gained = expectToComeApart(run, *frame, bySide(*frame));
    EXPECT_GT(gained, 0.1);
    margin += gained / 6.0;
  }
  EXPECT_GT(margin, 0.3);
}

class RenderedStructure : public testing::TestWithParam<StructureRun> {};

TEST_P(RenderedStructure, SubmapsPreserveMoreThanNaivePartsAtEveryLevel) {
  const auto frame = lastFrameOf(render(GetParam()), TrackerOptions(), Unit::kFree);
  ASSERT_TRUE(frame->submaps);
  const std::string name = testing::PrintToString(GetParam());
  int intermediate = 0;
  double gained = 0.0;
  for (const SubmapLevel& level : frame->submaps->levels) {
    if (level.submaps == 1 || level.submaps == static_cast<int>(frame->submaps->ids.size()))
      continue;
    ++intermediate;
    std::printf("%s: %d submaps: preserved %.3f, naive %.3f\n", name.c_str(), level.submaps,
                level.preserved_chow_liu, level.preserved_naive);
    // In the corridor, parts in the order of initialisation are sections of it: for two of them
    // hardly anything is better, and which corners are found decides.
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive - 0.06)
        << level.submaps << " submaps";
    gained += level.preserved_chow_liu - level.preserved_naive;
  }
  EXPECT_GE(intermediate, 1);
  EXPECT_GT(gained, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Scenes, RenderedStructure,
                         testing::Values(StructureRun{"two_depths", "slow", 1},
                                         StructureRun{"corridor", "forward", 1},
                                         StructureRun{"wall", "sideways", 1},
                                         StructureRun{"room", "slow", 1}));

/// Cut into so many submaps, the tree preserves more than naive parts by so much (Table 6.1), on
/// average over ten scenes: which corners are found moves one of them by a tenth.
void expectMargins(const std::string& scene, const std::string& motion,
                   const std::map<int, double>& margin_of_submaps) {
  std::map<int, double> gained;
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10}) {
    const StructureRun run = {scene, motion, seed};
    SCOPED_TRACE(testing::PrintToString(run));
    const auto frame = lastFrameOf(render(run), TrackerOptions(), Unit::kMetric);
    ASSERT_TRUE(frame->submaps);
    for (const auto& [submaps, margin] : margin_of_submaps) {
      const SubmapPartition cut = cutIntoSubmaps(*frame->graph, *frame->submaps, submaps);
      EXPECT_EQ(cut.submaps, submaps);
      const double naive = naivePreserved(*frame, submaps);
      std::printf("%s: %zu features in %d submaps: preserved %.3f, naive %.3f\n",
                  testing::PrintToString(run).c_str(), frame->submaps->ids.size(), submaps,
                  cut.preserved, naive);
      EXPECT_GT(cut.preserved, naive);
      gained[submaps] += (cut.preserved - naive) / 10.0;
    }
  }
  for (const auto& [submaps, margin] : margin_of_submaps)
    EXPECT_GT(gained[submaps], margin) << submaps << " submaps";
}

TEST(LongWallStructure, SectionsPreserveMoreThanNaivePartsByTheMarginOfTheThesis) {
  expectMargins("wall", "sideways", {{4, 0.938 - 0.747}, {10, 0.754 - 0.517}});
}

TEST(ForwardStructure, SectionsPreserveMoreThanNaivePartsByTheMarginOfTheThesis) {
  expectMargins("corridor", "forward", {{3, 0.855 - 0.745}, {18, 0.437 - 0.33}});
}

}  // namespace
}  // namespace active_matching_slam
