#include "active_matching_slam/ros/pose_conversions.h"

#include <stdexcept>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
geometry_msgs::Point toPointMsg(const Eigen::Vector3d& point) {
  geometry_msgs::Point message;
  message.x = point.x();
  message.y = point.y();
  message.z = point.z();
  return message;
}

geometry_msgs::Vector3 toVectorMsg(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

geometry_msgs::Pose toPoseMsg(const Eigen::Isometry3d& T_parent_child) {
  geometry_msgs::Pose message;
  message.position = toPointMsg(T_parent_child.translation());
  const Eigen::Quaterniond q = Eigen::Quaterniond(T_parent_child.linear()).normalized();
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  return message;
}

Eigen::Isometry3d fromTransformMsg(const geometry_msgs::Transform& transform) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const auto& r = transform.rotation;
  T.linear() = Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
  T.translation() << transform.translation.x, transform.translation.y, transform.translation.z;
  return T;
}

geometry_msgs::TransformStamped toTransformMsg(const Eigen::Isometry3d& T_parent_child,
                                               const ros::Time& stamp, const std::string& parent,
                                               const std::string& child) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform.translation = toVectorMsg(T_parent_child.translation());
  message.transform.rotation = toPoseMsg(T_parent_child).orientation;
  return message;
}

RigidBodyState rigidBodyState(const CameraState& camera, const MotionCovariance& covariance,
                              const Eigen::Isometry3d& T_camera_body) {
  const Eigen::Isometry3d T_world_camera = camera.poseWorldCamera();
  const Eigen::Matrix3d R_body_world =
      (T_world_camera.linear() * T_camera_body.linear()).transpose();
  const Eigen::Matrix3d R_body_camera = T_camera_body.linear().transpose();
  const Eigen::Vector3d lever_camera = T_camera_body.translation();
  const Eigen::Vector3d lever_world = T_world_camera.linear() * lever_camera;

  RigidBodyState state;
  state.T_world_body = T_world_camera * T_camera_body;

  // p_body = p + R lever and R_true = exp([r]x) R: dp_body = dp + r x (R lever).
  Eigen::Matrix<double, 6, 12> J_pose = Eigen::Matrix<double, 6, 12>::Zero();
  J_pose.block<3, 3>(0, CameraError::kPosition).setIdentity();
  J_pose.block<3, 3>(0, CameraError::kRotation) = -skew(lever_world);
  J_pose.block<3, 3>(3, CameraError::kRotation).setIdentity();
  state.pose_covariance = J_pose * covariance * J_pose.transpose();

  // v_body = R_body_world v_world + R_body_camera (w x lever); R_body_world errs by -R [r]x.
  state.linear_velocity_body = R_body_world * camera.velocity_world +
                               R_body_camera * camera.angular_velocity_camera.cross(lever_camera);
  state.angular_velocity_body = R_body_camera * camera.angular_velocity_camera;
  Eigen::Matrix<double, 6, 12> J_twist = Eigen::Matrix<double, 6, 12>::Zero();
  J_twist.block<3, 3>(0, CameraError::kRotation) = R_body_world * skew(camera.velocity_world);
  J_twist.block<3, 3>(0, CameraError::kVelocity) = R_body_world;
  J_twist.block<3, 3>(0, CameraError::kAngularVelocity) = -R_body_camera * skew(lever_camera);
  J_twist.block<3, 3>(3, CameraError::kAngularVelocity) = R_body_camera;
  state.twist_covariance = J_twist * covariance * J_twist.transpose();
  return state;
}

geometry_msgs::PoseWithCovarianceStamped toPoseWithCovarianceMsg(const RigidBodyState& state,
                                                                 const std_msgs::Header& header) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header = header;
  message.pose.pose = toPoseMsg(state.T_world_body);
  fillRowMajor(state.pose_covariance, &message.pose.covariance);
  return message;
}

nav_msgs::Odometry toOdometryMsg(const RigidBodyState& state, const std_msgs::Header& header,
                                 const std::string& child_frame) {
  nav_msgs::Odometry message;
  message.header = header;
  message.child_frame_id = child_frame;
  message.pose = toPoseWithCovarianceMsg(state, header).pose;
  message.twist.twist.linear = toVectorMsg(state.linear_velocity_body);
  message.twist.twist.angular = toVectorMsg(state.angular_velocity_body);
  fillRowMajor(state.twist_covariance, &message.twist.covariance);
  return message;
}

UncertainPose fromPoseWithCovarianceMsg(const geometry_msgs::PoseWithCovariance& message) {
  const auto& p = message.pose.position;
  const auto& q = message.pose.orientation;
  Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  UncertainPose pose{Eigen::Isometry3d::Identity(), Matrix6d::Zero()};
  pose.T_parent_child.translation() << p.x, p.y, p.z;
  if (!pose.T_parent_child.translation().allFinite() || !rotation.coeffs().allFinite() ||
      !(rotation.norm() > 0.0))
    throw std::invalid_argument("the pose is not finite, or its quaternion is zero");
  pose.T_parent_child.linear() = rotation.normalized().toRotationMatrix();
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      pose.covariance(row, column) =
          0.5 * (message.covariance[6 * row + column] + message.covariance[6 * column + row]);
  for (const int first : {0, 3}) {
    auto variances = pose.covariance.diagonal().segment<3>(first);
    const double largest = variances.maxCoeff();
    if (!pose.covariance.allFinite() || !(largest > 0.0) || variances.minCoeff() < 0.0)
      throw std::invalid_argument(std::string("the covariance of the ") +
                                  (first == 0 ? "position" : "rotation") +
                                  " is zero, negative or not finite");
    for (int i = 0; i < 3; ++i)
      if (variances[i] == 0.0) variances[i] = largest;
  }
  return pose;
}

UncertainPose transformed(const UncertainPose& pose, const Eigen::Isometry3d& T_new_parent,
                          const Eigen::Isometry3d& T_child_new) {
  UncertainPose result;
  result.T_parent_child = T_new_parent * pose.T_parent_child * T_child_new;
  // The new child's origin is on a lever.
  const Eigen::Vector3d lever = pose.T_parent_child.linear() * T_child_new.translation();
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() << 0.0, lever.z(), -lever.y(), -lever.z(), 0.0, lever.x(), lever.y(),
      -lever.x(), 0.0;
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = T_new_parent.linear();
  J = (turn * J).eval();
  result.covariance = J * pose.covariance * J.transpose();
  return result;
}

Eigen::Quaterniond bodyFromOptical() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Eigen::Quaterniond(R);
}

}  // namespace active_matching_slam
