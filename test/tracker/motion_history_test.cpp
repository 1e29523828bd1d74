#include "active_matching_slam/tracker/motion_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

MotionOptions by(const std::string& prior) {
  MotionOptions options;
  options.motion_prior = prior;
  return options;
}

Eigen::Isometry3d pose(const Eigen::Vector3d& position, const Eigen::Vector3d& turn) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotationFromVector(turn).toRotationMatrix();
  T.translation() = position;
  return T;
}

const Eigen::Isometry3d kCameraOnBase = pose({0.3, -0.1, 0.5}, {-1.2, 1.2, -1.2});

/// A base that goes in a curve, at a constant speed and rate.
Eigen::Isometry3d curve(double stamp_s) {
  const double angle = 0.4 * stamp_s;
  return pose({5.0 * std::sin(angle), 5.0 * (1.0 - std::cos(angle)), 0.0}, {0.0, 0.0, angle});
}

MotionHistory onACurve(double rate_hz, double end_s, MotionOptions options = by("odometry")) {
  MotionHistory history(options);
  history.setCamera(kCameraOnBase);
  for (int i = 0; i <= end_s * rate_hz; ++i) {
    OdometrySample sample;
    sample.stamp_s = i / rate_hz;
    sample.T_odom_base = curve(sample.stamp_s);
    EXPECT_EQ(history.add(sample), "");
  }
  return history;
}

TEST(OdometryHistory, TellsHowTheCameraMovedAndNotTheBase) {
  const MotionHistory history = onACurve(200.0, 3.0);
  const double from_s = 1.0003, to_s = 1.1007;  // between samples
  std::string why;
  const auto motion = history.between(from_s, to_s, &why);
  ASSERT_TRUE(motion) << why;
  const Eigen::Isometry3d T_start_end =
      (curve(from_s) * kCameraOnBase).inverse() * curve(to_s) * kCameraOnBase;
  const double interval_s = to_s - from_s;
  ASSERT_TRUE(motion->velocity_start);
  EXPECT_TRUE((interval_s * motion->velocity_start->mean)
                  .isApprox(Eigen::Vector3d(T_start_end.translation()), 1e-3));
  EXPECT_TRUE((interval_s * motion->angular_velocity_camera.mean)
                  .isApprox(vectorFromRotation(Eigen::Quaterniond(T_start_end.linear())), 1e-3));
  EXPECT_FALSE(motion->is_biased);
}

TEST(OdometryHistory, KnowsADistanceAsWellHoweverOftenItIsSaid) {
  const MotionHistory history = onACurve(50.0, 9.0);
  std::string why;
  const auto varianceOver = [&](double step_s) {
    double variance = 0.0;  // of the displacement over the same four seconds
    for (double t = 1.0; t < 5.0 - 1e-9; t += step_s) {
      const auto motion = history.between(t, t + step_s, &why);
      variance += motion ? motion->velocity_start->covariance.trace() * step_s * step_s : NAN;
    }
    return variance;
  };
  EXPECT_NEAR(varianceOver(0.1) / varianceOver(0.5), 1.0, 0.1);
}

TEST(OdometryHistory, TakesTheCovarianceThatMessagesState) {
  MotionHistory history(by("odometry"));
  history.setCamera(Eigen::Isometry3d::Identity());
  for (int i = 0; i <= 10; ++i) {
    OdometrySample sample;
    sample.stamp_s = 0.1 * i;
    sample.T_odom_base = pose({0.1 * i, 0.0, 0.0}, Eigen::Vector3d::Zero());
    sample.twist_covariance.diagonal() << 0.04, 0.09, 1e12, 0.01, 0.01, 0.25;
    history.add(sample);
  }
  std::string why;
  const auto motion = history.between(0.2, 0.3, &why);
  ASSERT_TRUE(motion) << why;
  EXPECT_NEAR(motion->velocity_start->covariance(0, 0), 0.04, 1e-3);
  EXPECT_NEAR(motion->velocity_start->covariance(1, 1), 0.09, 1e-3);
  EXPECT_GT(motion->velocity_start->covariance(2, 2), 1e4) << "not measured";
  EXPECT_NEAR(motion->angular_velocity_camera.covariance(2, 2), 0.25, 1e-3);
}

TEST(OdometryHistory, SaysWhyItKnowsNothing) {
  std::string why;
  MotionHistory history(by("odometry"));
  EXPECT_FALSE(history.between(1.0, 2.0, &why));
  EXPECT_NE(why.find("none has come"), std::string::npos) << why;

  history = onACurve(50.0, 3.0);
  EXPECT_FALSE(history.between(2.95, 3.05, &why));
  EXPECT_NE(why.find("none has come since"), std::string::npos) << why;
  EXPECT_FALSE(history.between(1000.0, 1000.1, &why));
  EXPECT_NE(why.find("clock"), std::string::npos) << why;
  EXPECT_FALSE(history.between(-1000.0, -999.9, &why));
  EXPECT_NE(why.find("clock"), std::string::npos) << why;
  EXPECT_TRUE(history.between(2.9, 3.0, &why)) << why;

  OdometrySample after_a_gap;
  after_a_gap.stamp_s = 6.0;
  after_a_gap.T_odom_base = curve(6.0);
  history.add(after_a_gap);
  EXPECT_FALSE(history.between(4.0, 4.1, &why));
  EXPECT_NE(why.find("gap"), std::string::npos) << why;
  EXPECT_TRUE(history.between(1.0, 1.1, &why)) << why;

  history.forgetCamera();
  EXPECT_FALSE(history.between(1.0, 1.1, &why));
  EXPECT_NE(why.find("camera"), std::string::npos) << why;
}

TEST(OdometryHistory, LeavesOutWhatIsLateOrNoPoseAndBeginsAnewWhenTimeDoes) {
  MotionHistory history = onACurve(50.0, 3.0);
  OdometrySample sample;
  sample.stamp_s = 2.5;
  sample.T_odom_base = pose({99.0, 0.0, 0.0}, Eigen::Vector3d::Zero());
  EXPECT_NE(history.add(sample).find("late"), std::string::npos);
  std::string why;
  const auto motion = history.between(2.45, 2.55, &why);
  ASSERT_TRUE(motion) << why;
  EXPECT_LT(motion->velocity_start->mean.norm(), 3.0);
  sample.stamp_s = 4.0;
  sample.T_odom_base.linear().setConstant(NAN);
  EXPECT_NE(history.add(sample), "");
  sample = OdometrySample();
  sample.stamp_s = 0.5;
  EXPECT_NE(history.add(sample).find("ran back"), std::string::npos);
  EXPECT_EQ(history.newest_s(), 0.5);
  EXPECT_FALSE(history.between(2.0, 2.1, &why));
}

TEST(GyroHistory, AddsUpTurnsInTheCamerasAxes) {
  MotionHistory history(by("gyro"));
  history.setCamera(kCameraOnBase);
  // Turns about an axis that turns itself.
  const auto rate = [](double t) { return Eigen::Vector3d(0.5, 2.0 * std::sin(3.0 * t), 1.0); };
  const double step_s = 0.002;
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(history.add(GyroSample{i * step_s, rate(i * step_s)}), "");
    if (i >= 200 && i < 300)
      for (int k = 0; k < 100; ++k)  // much finer than what is sampled
        turned = turned * rotationFromVector(0.01 * step_s * rate((i + 0.01 * (k + 0.5)) * step_s));
  }
  std::string why;
  const auto motion = history.between(0.4, 0.6, &why);
  ASSERT_TRUE(motion) << why;
  const Eigen::Vector3d expected =
      kCameraOnBase.linear().transpose() * vectorFromRotation(turned) / 0.2;
  EXPECT_LT((motion->angular_velocity_camera.mean - expected).norm(), 1e-4);
  EXPECT_TRUE(motion->is_biased);
  EXPECT_FALSE(motion->velocity_start);
}

TEST(MotionOptions, RefusesAPriorThatThereIsNot) {
  EXPECT_THROW(MotionHistory(by("imu")), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
