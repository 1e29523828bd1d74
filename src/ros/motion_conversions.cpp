#include "active_matching_slam/ros/motion_conversions.h"

#include <limits>
#include <stdexcept>

namespace active_matching_slam {
namespace {

Matrix6 fromRowMajor(const boost::array<double, 36>& values) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(values.data());
}

}  // namespace

OdometrySample fromOdometryMsg(const nav_msgs::Odometry& message) {
  OdometrySample sample;
  sample.stamp_s = message.header.stamp.toSec();
  const auto& t = message.pose.pose.position;
  const auto& r = message.pose.pose.orientation;
  const Eigen::Quaterniond q(r.w, r.x, r.y, r.z);
  sample.T_odom_base.translation() << t.x, t.y, t.z;
  if (q.norm() > 0.5) {
    sample.T_odom_base.linear() = q.normalized().toRotationMatrix();
  } else {
    sample.T_odom_base.linear().setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  sample.pose_covariance = fromRowMajor(message.pose.covariance);
  sample.twist_covariance = fromRowMajor(message.twist.covariance);
  return sample;
}

GyroSample fromImuMsg(const sensor_msgs::Imu& message) {
  // As the message's definition has it.
  if (message.angular_velocity_covariance[0] == -1.0)
    throw std::invalid_argument("the IMU has no gyroscope: its angular_velocity_covariance is -1");
  const auto& w = message.angular_velocity;
  return {message.header.stamp.toSec(), Eigen::Vector3d(w.x, w.y, w.z)};
}

}  // namespace active_matching_slam
