// The structure found in recordings of real cameras, against the naive partition: as many submaps
// of equal size in order of initialisation (Chli 2009, Table 6.1).

#include <gtest/gtest.h>

#include <cstdio>
#include <map>
#include <memory>
#include <numeric>

#include "active_matching_slam/evaluation/recorded_sequence.h"
#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/tracker/tracker.h"
#include "support/recorded_data.h"

namespace active_matching_slam {
namespace {

/// Mean bits of the links inside the parts of a partition.
double bitsInside(const MutualInformationGraph& graph, const std::vector<int>& labels) {
  std::vector<double> bits;
  for (const WeightedEdge& edge : graphEdges(graph))
    if (labels[edge.first] == labels[edge.second]) bits.push_back(edge.weight);
  return std::accumulate(bits.begin(), bits.end(), 0.0) / bits.size();
}

bool isIntermediate(const SubmapLevel& level) {
  return level.submaps > 1 && level.submaps < static_cast<int>(level.submap_of_feature.size());
}

class RecordedStructure : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (recordedDataFolder().empty()) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  }
};

// At the end of the run, when the averages of the graph span it, and in sum over the run. At one
// moment the first level can come out either way: with three to four features in a
// submap, most of what counts as preserved is the strongest link between each two of the many
// submaps, and scattered parts hold more such links.
TEST_P(RecordedStructure, SubmapsPreserveMoreThanNaivePartsAtEveryLevel) {
  TrackerOptions options;
  options.structure = true;
  RecordedSequence sequence(recordedDataFolder() + "/" + GetParam());
  Tracker tracker(sequence.camera(), options);
  std::map<std::size_t, double> gain;  // by level, summed over the frames
  std::shared_ptr<const TrackedFrame> last;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    const auto frame = tracker.track(image, stamp_s);
    if (!frame->submaps) return true;
    last = frame;
    for (std::size_t h = 0; h < frame->submaps->levels.size(); ++h) {
      const SubmapLevel& level = frame->submaps->levels[h];
      if (isIntermediate(level)) gain[h] += level.preserved_chow_liu - level.preserved_naive;
    }
    return true;
  });
  ASSERT_GE(gain.size(), 2u);
  for (const auto& [level, sum] : gain) EXPECT_GT(sum, 0.0) << "level " << level;
  for (std::size_t h = 2; h < last->submaps->levels.size(); ++h) {
    const SubmapLevel& level = last->submaps->levels[h];
    if (!isIntermediate(level)) continue;
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive) << level.submaps << " submaps";
  }
  // What a submap is for: strong links within.
  const SubmapLevel& first = last->submaps->levels.at(1);
  const int features = static_cast<int>(first.submap_of_feature.size());
  EXPECT_GT(bitsInside(*last->graph, first.submap_of_feature),
            1.2 * bitsInside(*last->graph, naivePartition(features, first.submaps)));
}

// With about as many features in a frame as the thesis's maps have, also the first level.
TEST_P(RecordedStructure, SparseMapsPreserveMoreThanNaivePartsAtTheFirstLevelToo) {
  TrackerOptions options;
  options.structure = true;
  options.map.features_per_frame = 15;
  RecordedSequence sequence(recordedDataFolder() + "/" + GetParam());
  Tracker tracker(sequence.camera(), options);
  std::shared_ptr<const TrackedFrame> last;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    const auto frame = tracker.track(image, stamp_s);
    if (frame->submaps) last = frame;
    return true;
  });
  ASSERT_TRUE(last);
  int intermediate = 0;
  for (const SubmapLevel& level : last->submaps->levels) {
    if (!isIntermediate(level)) continue;
    ++intermediate;
    std::printf("%s: %zu features in %d submaps: preserved %.3f, naive %.3f\n", GetParam(),
                level.submap_of_feature.size(), level.submaps, level.preserved_chow_liu,
                level.preserved_naive);
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive) << level.submaps << " submaps";
  }
  EXPECT_GE(intermediate, 1);
}

INSTANTIATE_TEST_SUITE_P(Sequences, RecordedStructure,
                         testing::Values("davison_monoslam_desk", "uzh_vamr_checkerboard",
                                         "sevenscenes_redkitchen", "oekf_desk_translation"));

}  // namespace
}  // namespace active_matching_slam
