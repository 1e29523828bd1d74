// The desk, mapped from the first half of its recording and found again in the second.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "accuracy/long_runs.h"
#include "accuracy/recorded_run.h"

namespace active_matching_slam {
namespace {

class RecordedLocalisation : public test::RecordedRuns {};

TEST_F(RecordedLocalisation, OfTheSecondHalfByAMapOfTheFirst) {
  constexpr int kHalf = 500;
  const std::string name = "davison_monoslam_desk";
  const std::string path = testing::TempDir() + "/desk_" + std::to_string(::getpid()) + ".map";
  const RecordedSequence sequence(recordedDataFolder() + "/" + name);
  TrackerOptions options;
  options.known_points =
      readKnownPointsYaml(recordedDataFolder() + "/" + name + "/known_target.yaml");
  Tracker mapper(sequence.camera(), options);
  options.mapping = false;
  Tracker follower(sequence.camera(), options);
  test::RecordedRun first, second;
  first.name = second.name = name;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    if (first.frames() < kHalf) {
      first.records.push_back(recordOf(*mapper.track(image, stamp_s)));
      if (first.frames() == kHalf) {
        mapper.saveMap(path);
        follower.loadMap(path);
      }
    } else {
      second.records.push_back(recordOf(*follower.track(image, stamp_s)));
    }
    return true;
  });
  std::filesystem::remove(path);
  RecordProperty("tracked", second.framesTracked());
  RecordProperty("first_mm", std::to_string(test::errorMm(first, AlignmentKind::kRigid)));
  RecordProperty("second_mm", std::to_string(test::errorMm(second, AlignmentKind::kRigid)));
  EXPECT_GT(second.framesTracked(), 0.8 * second.frames());
  // No pose is wrong: rigidly aligned, so in the scale of the map.
  EXPECT_LT(test::errorMm(second, AlignmentKind::kRigid), 40.0);
}

}  // namespace
}  // namespace active_matching_slam
