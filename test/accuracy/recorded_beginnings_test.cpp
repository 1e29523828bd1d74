// The default configuration on the first images of recordings of real cameras. Errors are of the
// poses as they were given out at the time, over every frame.

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "accuracy/long_runs.h"
#include "accuracy/recorded_run.h"

namespace active_matching_slam {
namespace {

using test::errorMm;
using test::RecordedRun;
using test::RecordedRunOptions;
using test::trackRecording;

constexpr int kFrames = 200;

class RecordedBeginnings : public test::RecordedRuns {};

TEST_F(RecordedBeginnings, AreTracked) {
  RecordedRunOptions options;
  options.maximum_frames = kFrames;
  for (const auto& [name, limit_mm] :
       {std::make_pair("davison_monoslam_desk", 15.0), std::make_pair("uzh_vamr_checkerboard", 4.0),
        std::make_pair("sevenscenes_redkitchen", 65.0)}) {
    const RecordedRun run = trackRecording(name, options);
    EXPECT_EQ(run.framesTracked(), run.frames()) << name;
    EXPECT_LE(errorMm(run), limit_mm) << name;
  }
}

TEST_F(RecordedBeginnings, AreTrackedAtThreeTimesTheSpeed) {
  RecordedRunOptions options;
  options.maximum_frames = kFrames;
  options.every = 3;
  options.speed = 3.0;
  const RecordedRun run = trackRecording("davison_monoslam_desk", options);
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_LE(errorMm(run), 15.0);
}

TEST_F(RecordedBeginnings, AreTrackedToScaleWithATarget) {
  RecordedRunOptions options;
  options.maximum_frames = kFrames;
  options.known_target = true;
  const RecordedRun run = trackRecording("davison_monoslam_desk", options);
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_LE(errorMm(run, AlignmentKind::kRigid), 20.0);
}

TEST_F(RecordedBeginnings, ActiveMatchingKeepsTheCheckerboardAtSevenAndAHalfHertz) {
  RecordedRunOptions options;
  options.maximum_frames = kFrames / 4;
  options.every = 4;
  options.tracker.matcher = "active";
  const RecordedRun run = trackRecording("uzh_vamr_checkerboard", options);
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_LE(errorMm(run), 6.0);
}

/// A car at 10 Hz, with the settings that a hand at 30 Hz is tracked with.
TEST_F(RecordedBeginnings, ACarIsTrackedWithTheDefaults) {
  const RecordedRun run = trackRecording("kitti_07_first160");
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_LE(errorMm(run), 1000.0) << "of a path of 91 m";
}

class Quality : public test::RecordedRuns {};

TEST_F(Quality, TellsWrongCalibrationsFromTheRightOne) {
  const auto medianQuality = [](const std::string& name,
                                const std::function<void(CameraCalibration*)>& change) {
    RecordedRunOptions options;
    options.maximum_frames = 150;
    options.change_calibration = change;
    std::vector<double> qualities;
    for (const FrameRecord& record : trackRecording(name, options).records)
      if (record.isTracked() && record.quality < 1.0) qualities.push_back(record.quality);
    return qualities.empty() ? 1.0 : percentile(qualities, 0.5);
  };
  const auto halveFocal = [](CameraCalibration* c) {
    c->fx *= 0.5;
    c->fy *= 0.5;
  };
  const auto forgetDistortion = [](CameraCalibration* c) {
    c->distortion_model = DistortionModel::kPlumbBob;
    c->distortion.assign(5, 0.0);
  };
  for (const std::string name : {"davison_monoslam_desk", "uzh_vamr_checkerboard"}) {
    const double right = medianQuality(name, {});
    EXPECT_GT(right, 0.5) << name;
    EXPECT_LT(medianQuality(name, halveFocal), 0.5) << name;
    EXPECT_LT(medianQuality(name, forgetDistortion), 0.5) << name;
  }
}

// The first images, of which the filter knows least, take the matchers longest. After two seconds
// the hand jerks, which takes a second attempt: for that a millisecond is not enough.
TEST_F(RecordedBeginnings, AStartInAHurryIsNoLostStart) {
  const std::string folder = recordedDataFolder() + "/sevenscenes_redkitchen";
  for (const auto& [max_milliseconds, images] : {std::pair{1.0, 60}, std::pair{2.0, 90}}) {
    SCOPED_TRACE(max_milliseconds);
    RecordedSequence sequence(folder);
    TrackerOptions options;
    double now_s = 0.0;
    options.matching.clock_s = [&now_s] { return now_s += 2e-5; };  // for each look at it
    options.matching.max_milliseconds = max_milliseconds;
    Tracker tracker(sequence.camera(), options);
    int frames = 0, cut_short = 0;
    const int count = images;
    sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
      const auto frame = tracker.track(image, stamp_s);
      cut_short += frame->matching.statistics.cut_short;
      EXPECT_EQ(frame->resets, 0) << frames;
      if (frames > 0 && !frame->repeated_image) {
        EXPECT_EQ(TrackingState::kTracking, frame->state) << frames;
        // Three points make a pose; as many again say that it is right.
        EXPECT_GE(frame->matching.statistics.matched, 6) << frames;
      }
      return ++frames < count;
    });
    EXPECT_GE(cut_short, 5);
  }
}

}  // namespace
}  // namespace active_matching_slam
