// The structure found in recordings of real cameras, against the naive partition: as many submaps
// of equal size in order of initialisation (Chli 2009, Table 6.1).

#include <gtest/gtest.h>

#include <cstdio>
#include <map>
#include <memory>

#include "active_matching_slam/evaluation/recorded_sequence.h"
#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/tracker/tracker.h"
#include "support/recorded_data.h"

namespace active_matching_slam {
namespace {

bool isIntermediate(const SubmapLevel& level) {
  return level.submaps > 1 && level.submaps < static_cast<int>(level.submap_of_feature.size());
}

class RecordedStructure : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (recordedDataFolder().empty()) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  }
};

// At the end of the run, when the averages of the graph span it, and in sum over the run.
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
  for (const SubmapLevel& level : last->submaps->levels) {
    if (!isIntermediate(level)) continue;
    EXPECT_GT(level.preserved_chow_liu, level.preserved_naive) << level.submaps << " submaps";
  }
}

// With about as many features in a frame as the thesis's maps have.
TEST_P(RecordedStructure, SparseMapsPreserveMoreThanNaivePartsAtEveryLevel) {
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
