#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "active_matching_slam/filter/camera_state.h"

namespace active_matching_slam {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

inline double finiteOrZero(double value) { return std::isfinite(value) ? value : 0.0; }

/// Into the array of a message, row by row; what is not finite becomes zero.
template <typename Matrix, typename Array>
void fillRowMajor(const Matrix& matrix, Array* array) {
  for (int row = 0; row < matrix.rows(); ++row)
    for (int col = 0; col < matrix.cols(); ++col)
      (*array)[row * matrix.cols() + col] = finiteOrZero(matrix(row, col));
}

geometry_msgs::Point toPointMsg(const Eigen::Vector3d& point);
geometry_msgs::Vector3 toVectorMsg(const Eigen::Vector3d& vector);
geometry_msgs::Pose toPoseMsg(const Eigen::Isometry3d& T_parent_child);
Eigen::Isometry3d fromTransformMsg(const geometry_msgs::Transform& transform);

/// T_parent_child maps points of the child frame into the parent frame: tf's own meaning of a
/// transform with header.frame_id = parent and child_frame_id = child.
geometry_msgs::TransformStamped toTransformMsg(const Eigen::Isometry3d& T_parent_child,
                                               const ros::Time& stamp, const std::string& parent,
                                               const std::string& child);

/// State of a frame fixed to the camera, in ROS conventions.
struct RigidBodyState {
  Eigen::Isometry3d T_world_body;
  /// Of x y z, then rotations about the fixed axes of the world frame (REP 103) [m^2, rad^2].
  Matrix6d pose_covariance;
  Eigen::Vector3d linear_velocity_body;   ///< of the body's origin, in the body frame [m/s]
  Eigen::Vector3d angular_velocity_body;  ///< in the body frame [rad/s]
  Matrix6d twist_covariance;              ///< linear, then angular, in the body frame
};

/// `T_camera_body` (body points into the camera frame) is taken as exactly known; identity
/// describes the camera itself. `covariance` is in CameraError order. First order.
RigidBodyState rigidBodyState(const CameraState& camera, const MotionCovariance& covariance,
                              const Eigen::Isometry3d& T_camera_body);

geometry_msgs::PoseWithCovarianceStamped toPoseWithCovarianceMsg(const RigidBodyState& state,
                                                                 const std_msgs::Header& header);
nav_msgs::Odometry toOdometryMsg(const RigidBodyState& state, const std_msgs::Header& header,
                                 const std::string& child_frame);

/// A pose that is known with some uncertainty: of x y z, then rotations about the parent's fixed
/// axes [m^2, rad^2].
struct UncertainPose {
  Eigen::Isometry3d T_parent_child;
  Matrix6d covariance;
};

/// A variance of 0 stands for one that was left out, as rviz leaves out height, roll and pitch: it
/// takes the largest of its kind. Throws std::invalid_argument for numbers that are no pose, or a
/// covariance that is zero.
UncertainPose fromPoseWithCovarianceMsg(const geometry_msgs::PoseWithCovariance& message);

/// The same of another child in another parent, both fixed to those before. First order.
UncertainPose transformed(const UncertainPose& pose, const Eigen::Isometry3d& T_new_parent,
                          const Eigen::Isometry3d& T_child_new);

/// Optical axes (x right, y down, z forward) to body axes (x forward, y left, z up), REP 103: the
/// rotation that takes a vector's optical coordinates to its body coordinates.
Eigen::Quaterniond bodyFromOptical();

}  // namespace active_matching_slam
