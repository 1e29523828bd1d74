// A car with the odometry that it might have had: made from its true poses, with noise and a slip.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "accuracy/long_runs.h"
#include "accuracy/recorded_run.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/tracker/motion_history.h"

namespace active_matching_slam {
namespace {

constexpr double kStepNoise = 0.02;  // of each step's length, per axis; of its turn likewise
constexpr double kSlipM = 0.5;

class RecordedOdometry : public test::RecordedRuns {};

std::shared_ptr<MotionHistory> odometryOf(const Trajectory& truth, const MotionOptions& options) {
  Eigen::Isometry3d T_base_camera = Eigen::Isometry3d::Identity();
  T_base_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  T_base_camera.translation() << 0.1, 0.0, 0.3;
  auto history = std::make_shared<MotionHistory>(options);
  history->setCamera(T_base_camera);
  std::mt19937 engine(1);
  std::normal_distribution<double> normal;
  const auto random = [&](double sigma) {
    const double x = normal(engine), y = normal(engine), z = normal(engine);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
  };
  OdometrySample sample;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    if (k > 0) {
      Eigen::Isometry3d step = T_base_camera * truth[k - 1].T_world_camera.inverse() *
                               truth[k].T_world_camera * T_base_camera.inverse();
      const double turn = vectorFromRotation(Eigen::Quaterniond(step.linear())).norm();
      step.translation() += random(kStepNoise * step.translation().norm());
      step.linear() = step.linear() * rotationFromVector(random(kStepNoise * turn)).matrix();
      if (k == truth.size() / 2) step.translation().x() += kSlipM;
      sample.T_odom_base = sample.T_odom_base * step;
      sample.T_odom_base.linear() =
          Eigen::Quaterniond(sample.T_odom_base.linear()).normalized().matrix();
    }
    sample.stamp_s = truth[k].stamp_s;
    history->add(sample);
  }
  return history;
}

TEST_F(RecordedOdometry, MakesTheMapOfACarMetric) {
  test::RecordedRun run;
  run.name = "kitti_07_first160";
  const RecordedSequence sequence(recordedDataFolder() + "/" + run.name);
  TrackerOptions options;
  options.motion.motion_prior = "odometry";
  Tracker tracker(sequence.camera(), options);
  tracker.setMotionHistory(odometryOf(test::truthOf(run.name), options.motion));
  int slipped = 0;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    const auto frame = tracker.track(image, stamp_s);
    if (frame->rescaled_by != 1.0)
      rescaleRecords(frame->rescaled_by, frame->scale_sigma, frame->map, &run.records);
    run.records.push_back(recordOf(*frame));
    if (!frame->motion_source.empty() && !frame->motion_fault.empty()) ++slipped;
    return true;
  });
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_EQ(run.records.back().scale_source, ScaleSource::kOdometry);
  const auto similarity =
      align(pairPoses(run.tracked(), test::truthOf(run.name)), AlignmentKind::kSimilarity);
  ASSERT_TRUE(similarity);
  RecordProperty("rigid_mm", std::to_string(test::errorMm(run, AlignmentKind::kRigid)));
  RecordProperty("similarity_mm", std::to_string(test::errorMm(run)));
  RecordProperty("scale", std::to_string(similarity->scale));
  RecordProperty("slipped", slipped);
  EXPECT_LT(test::errorMm(run, AlignmentKind::kRigid), 1000.0);
  EXPECT_NEAR(similarity->scale, 1.0, 0.02);
  EXPECT_GE(slipped, 1);
  EXPECT_LE(slipped, 3);
}

/// Of the cameras over the ground (Geiger et al. 2012, The KITTI vision benchmark suite).
constexpr double kCameraHeightM = 1.65;

TEST_F(RecordedOdometry, TheHeightOfTheCameraMakesTheMapOfACarMetric) {
  test::RecordedRun run;
  run.name = "kitti_07_first160";
  const RecordedSequence sequence(recordedDataFolder() + "/" + run.name);
  TrackerOptions options;
  options.ground.camera_height_m = kCameraHeightM;
  Tracker tracker(sequence.camera(), options);
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    const auto frame = tracker.track(image, stamp_s);
    if (frame->rescaled_by != 1.0)
      rescaleRecords(frame->rescaled_by, frame->scale_sigma, frame->map, &run.records);
    run.records.push_back(recordOf(*frame));
    return true;
  });
  EXPECT_EQ(run.framesTracked(), run.frames());
  EXPECT_EQ(run.records.back().scale_source, ScaleSource::kCameraHeight);
  const auto similarity =
      align(pairPoses(run.tracked(), test::truthOf(run.name)), AlignmentKind::kSimilarity);
  ASSERT_TRUE(similarity);
  RecordProperty("rigid_mm", std::to_string(test::errorMm(run, AlignmentKind::kRigid)));
  RecordProperty("scale", std::to_string(similarity->scale));
  EXPECT_NEAR(similarity->scale, 1.0, 0.05);
}

}  // namespace
}  // namespace active_matching_slam
