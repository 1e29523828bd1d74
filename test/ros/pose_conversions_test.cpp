#include "active_matching_slam/ros/pose_conversions.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>
#include <random>

#include "support/fault.h"

namespace active_matching_slam {
namespace {

Eigen::Quaterniond rotation(const Eigen::Vector3d& vector) {
  return vector.norm() > 0.0
             ? Eigen::Quaterniond(Eigen::AngleAxisd(vector.norm(), vector.normalized()))
             : Eigen::Quaterniond::Identity();
}

Eigen::Vector3d rotationVector(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd angle_axis(R);
  return angle_axis.angle() * angle_axis.axis();
}

CameraState movingCamera() {
  CameraState camera;
  camera.position_world << 0.4, -1.2, 2.0;
  camera.q_world_camera = rotation({0.7, -1.1, 0.4});
  camera.velocity_world << 0.8, 0.3, -0.5;
  camera.angular_velocity_camera << -0.2, 0.9, 0.6;
  return camera;
}

/// A covariance without symmetries that could hide a wrong order or a missing rotation.
MotionCovariance lopsidedCovariance() {
  MotionCovariance L = MotionCovariance::Zero();
  for (int row = 0; row < 12; ++row)
    for (int col = 0; col <= row; ++col)
      L(row, col) = 0.004 * (1.0 + 0.3 * ((row * 5 + col * 3) % 7)) * (row == col ? 1.5 : 0.4);
  return L * L.transpose();
}

Eigen::Isometry3d leverArm() {
  Eigen::Isometry3d T_camera_body = Eigen::Isometry3d::Identity();
  T_camera_body.linear() = rotation({0.2, 1.3, -0.8}).toRotationMatrix();
  T_camera_body.translation() << 0.3, -0.2, 0.5;
  return T_camera_body;
}

struct SampledCovariance {
  Matrix6d pose = Matrix6d::Zero(), twist = Matrix6d::Zero();
};

/// Draws true cameras around the mean, moves each to the body by the definitions of pose and twist
/// alone, and takes the covariance of the results.
SampledCovariance sampleCovariance(const CameraState& mean, const MotionCovariance& covariance,
                                   const Eigen::Isometry3d& T_camera_body, int count) {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  const MotionCovariance L = covariance.llt().matrixL();
  const RigidBodyState body = rigidBodyState(mean, covariance, T_camera_body);
  SampledCovariance sampled;
  for (int i = 0; i < count; ++i) {
    Eigen::Matrix<double, 12, 1> noise;
    for (double& value : noise) value = normal(generator);
    const Eigen::Matrix<double, 12, 1> error = L * noise;
    CameraState truth = mean;
    truth.position_world += error.segment<3>(CameraError::kPosition);
    truth.q_world_camera = rotation(error.segment<3>(CameraError::kRotation)) * mean.q_world_camera;
    truth.velocity_world += error.segment<3>(CameraError::kVelocity);
    truth.angular_velocity_camera += error.segment<3>(CameraError::kAngularVelocity);

    const Eigen::Isometry3d T_world_body = truth.poseWorldCamera() * T_camera_body;
    Eigen::Matrix<double, 6, 1> pose_error, twist_error;
    pose_error << T_world_body.translation() - body.T_world_body.translation(),
        rotationVector(T_world_body.linear() * body.T_world_body.linear().transpose());
    const Eigen::Matrix3d R_world_camera = truth.q_world_camera.toRotationMatrix();
    const Eigen::Vector3d w_world = R_world_camera * truth.angular_velocity_camera;
    const Eigen::Vector3d v_world =
        truth.velocity_world + w_world.cross(R_world_camera * T_camera_body.translation());
    twist_error << T_world_body.linear().transpose() * v_world - body.linear_velocity_body,
        T_world_body.linear().transpose() * w_world - body.angular_velocity_body;
    sampled.pose += pose_error * pose_error.transpose() / count;
    sampled.twist += twist_error * twist_error.transpose() / count;
  }
  return sampled;
}

void expectClose(const Matrix6d& stated, const Matrix6d& sampled, double tolerance) {
  for (int row = 0; row < 6; ++row)
    for (int col = 0; col < 6; ++col)
      EXPECT_NEAR(stated(row, col), sampled(row, col),
                  tolerance * std::sqrt(stated(row, row) * stated(col, col)))
          << "at " << row << ", " << col;
}

TEST(PoseConversions, CovarianceOfTheCameraIsThatOfSampledPosesInTheFrameOfTheHeader) {
  const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
  const RigidBodyState camera = rigidBodyState(movingCamera(), lopsidedCovariance(), identity);
  const SampledCovariance sampled =
      sampleCovariance(movingCamera(), lopsidedCovariance(), identity, 40000);
  expectClose(camera.pose_covariance, sampled.pose, 0.03);
  expectClose(camera.twist_covariance, sampled.twist, 0.03);
}

TEST(PoseConversions, CovarianceOfABodyOnALeverIsThatOfSampledPosesAndTwists) {
  const RigidBodyState body = rigidBodyState(movingCamera(), lopsidedCovariance(), leverArm());
  const SampledCovariance sampled =
      sampleCovariance(movingCamera(), lopsidedCovariance(), leverArm(), 40000);
  expectClose(body.pose_covariance, sampled.pose, 0.03);
  expectClose(body.twist_covariance, sampled.twist, 0.03);
}

TEST(PoseConversions, TwistIsTheMotionOfTheBodySeenFromTheBody) {
  const CameraState now = movingCamera();
  const RigidBodyState body = rigidBodyState(now, MotionCovariance::Identity(), leverArm());
  const double dt = 1e-6;
  CameraState later = now;
  later.position_world += dt * now.velocity_world;
  later.q_world_camera = now.q_world_camera * rotation(dt * now.angular_velocity_camera);
  const Eigen::Isometry3d T_before = now.poseWorldCamera() * leverArm();
  const Eigen::Isometry3d T_after = later.poseWorldCamera() * leverArm();
  const Eigen::Isometry3d T_step = T_before.inverse() * T_after;
  EXPECT_TRUE(body.linear_velocity_body.isApprox(T_step.translation() / dt, 1e-5));
  EXPECT_TRUE(body.angular_velocity_body.isApprox(rotationVector(T_step.linear()) / dt, 1e-5));
}

TEST(PoseConversions, OdometryHoldsCovariancesRowByRowInRosOrder) {
  std_msgs::Header header;
  header.frame_id = "world";
  header.stamp = ros::Time(12, 34);
  const RigidBodyState body = rigidBodyState(movingCamera(), lopsidedCovariance(), leverArm());
  const nav_msgs::Odometry odometry = toOdometryMsg(body, header, "base_link");
  EXPECT_EQ("world", odometry.header.frame_id);
  EXPECT_EQ("base_link", odometry.child_frame_id);
  EXPECT_EQ(header.stamp, odometry.header.stamp);
  for (int row = 0; row < 6; ++row)
    for (int col = 0; col < 6; ++col) {
      EXPECT_EQ(body.pose_covariance(row, col), odometry.pose.covariance[6 * row + col]);
      EXPECT_EQ(body.twist_covariance(row, col), odometry.twist.covariance[6 * row + col]);
    }
  EXPECT_EQ(body.linear_velocity_body.y(), odometry.twist.twist.linear.y);
  EXPECT_EQ(body.angular_velocity_body.z(), odometry.twist.twist.angular.z);
}

TEST(PoseConversions, QuaternionGoesIntoTheMessageComponentByComponent) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Eigen::Quaterniond q(0.8, 0.1, -0.3, std::sqrt(1.0 - 0.64 - 0.01 - 0.09));
  T.linear() = q.toRotationMatrix();
  T.translation() << 1, 2, 3;
  const geometry_msgs::Pose pose = toPoseMsg(T);
  EXPECT_NEAR(0.8, pose.orientation.w, 1e-12);
  EXPECT_NEAR(0.1, pose.orientation.x, 1e-12);
  EXPECT_NEAR(-0.3, pose.orientation.y, 1e-12);
  EXPECT_NEAR(q.z(), pose.orientation.z, 1e-12);
  EXPECT_EQ(2.0, pose.position.y);
}

TEST(PoseConversions, TransformMapsPointsOfTheChildIntoTheParent) {
  const Eigen::Isometry3d T_world_camera = movingCamera().poseWorldCamera();
  const geometry_msgs::TransformStamped message =
      toTransformMsg(T_world_camera, ros::Time(3), "world", "camera");
  EXPECT_EQ("world", message.header.frame_id);
  EXPECT_EQ("camera", message.child_frame_id);
  const Eigen::Vector3d ahead_camera(0, 0, 1);
  EXPECT_TRUE((fromTransformMsg(message.transform) * ahead_camera)
                  .isApprox(T_world_camera * ahead_camera, 1e-12));
}

TEST(UncertainPose, OfAnotherChildIsAsThatOfABodyOnALever) {
  const UncertainPose camera{movingCamera().poseWorldCamera(),
                             lopsidedCovariance().topLeftCorner<6, 6>()};
  const RigidBodyState body = rigidBodyState(movingCamera(), lopsidedCovariance(), leverArm());
  const UncertainPose moved = transformed(camera, Eigen::Isometry3d::Identity(), leverArm());
  EXPECT_TRUE(moved.T_parent_child.isApprox(body.T_world_body, 1e-12));
  EXPECT_TRUE(moved.covariance.isApprox(body.pose_covariance, 1e-9));
}

TEST(UncertainPose, ThereAndBackIsTheSame) {
  const UncertainPose camera{movingCamera().poseWorldCamera(),
                             lopsidedCovariance().topLeftCorner<6, 6>()};
  Eigen::Isometry3d T_map_world = leverArm();
  const UncertainPose again = transformed(transformed(camera, T_map_world, leverArm()),
                                          T_map_world.inverse(), leverArm().inverse());
  EXPECT_TRUE(again.T_parent_child.isApprox(camera.T_parent_child, 1e-12));
  EXPECT_TRUE(again.covariance.isApprox(camera.covariance, 1e-9));
}

TEST(UncertainPose, OfRvizHasWhatItLeavesOutAsUnknown) {
  geometry_msgs::PoseWithCovariance message;
  message.pose.orientation.w = 1.0;
  message.covariance[0] = message.covariance[7] = 0.25;
  message.covariance[35] = 0.07;
  const UncertainPose pose = fromPoseWithCovarianceMsg(message);
  Eigen::Matrix<double, 6, 1> expected;
  expected << 0.25, 0.25, 0.25, 0.07, 0.07, 0.07;
  EXPECT_EQ(pose.covariance, Matrix6d(expected.asDiagonal()));
}

TEST(UncertainPose, WhatIsNoneIsRefusedByName) {
  const auto fault = [](const std::function<void(geometry_msgs::PoseWithCovariance*)>& spoil) {
    geometry_msgs::PoseWithCovariance message;
    message.pose.orientation.w = 1.0;
    for (int i = 0; i < 6; ++i) message.covariance[7 * i] = 0.1;
    spoil(&message);
    return faultOf([&] { fromPoseWithCovarianceMsg(message); });
  };
  EXPECT_EQ(fault([](auto*) {}), "");
  EXPECT_NE(fault([](auto* m) { m->pose.orientation.w = 0.0; }).find("quaternion"),
            std::string::npos);
  EXPECT_NE(fault([](auto* m) { m->pose.position.x = NAN; }).find("finite"), std::string::npos);
  EXPECT_NE(fault([](auto* m) { m->covariance[7] = -1.0; }).find("position"), std::string::npos);
  EXPECT_NE(fault([](auto* m) {
              m->covariance[21] = m->covariance[28] = m->covariance[35] = 0.0;
            }).find("rotation"),
            std::string::npos);
}

TEST(PoseConversions, OpticalAxesBecomeBodyAxes) {
  const Eigen::Quaterniond q = bodyFromOptical();
  EXPECT_TRUE((q * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX())) << "forward";
  EXPECT_TRUE((q * Eigen::Vector3d::UnitX()).isApprox(-Eigen::Vector3d::UnitY())) << "right";
  EXPECT_TRUE((q * Eigen::Vector3d::UnitY()).isApprox(-Eigen::Vector3d::UnitZ())) << "down";
}

}  // namespace
}  // namespace active_matching_slam
