#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>

#include "active_matching_slam/tracker/motion_history.h"

namespace active_matching_slam {

/// A quaternion of no length gives a pose that MotionHistory refuses.
OdometrySample fromOdometryMsg(const nav_msgs::Odometry& message);

/// Throws std::invalid_argument where the message says that it has no angular velocity.
GyroSample fromImuMsg(const sensor_msgs::Imu& message);

}  // namespace active_matching_slam
