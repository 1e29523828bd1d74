#include "active_matching_slam/ros/trajectory_log.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {

void TrajectoryLog::add(const TrackedFrame& frame) {
  poses_.push_back({frame.stamp_s, frame.camera.position_world, frame.camera.q_world_camera,
                    frame.camera_covariance.topLeftCorner<3, 3>()});
  while (static_cast<int>(poses_.size()) > maximum_poses_) poses_.pop_front();
}

void TrajectoryLog::rescale(double factor) {
  for (Pose& pose : poses_) {
    pose.position_world *= factor;
    pose.position_covariance *= factor * factor;
  }
}

std::deque<TrajectoryLog::Pose>::const_iterator TrajectoryLog::lastPoses(int length) const {
  return static_cast<int>(poses_.size()) > length ? poses_.end() - length : poses_.begin();
}

nav_msgs::Path TrajectoryLog::path(int length, const std_msgs::Header& header) const {
  nav_msgs::Path path;
  path.header = header;
  for (auto pose = lastPoses(length); pose != poses_.end(); ++pose) {
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    T_world_camera.linear() = pose->q_world_camera.toRotationMatrix();
    T_world_camera.translation() = pose->position_world;
    geometry_msgs::PoseStamped& stamped = path.poses.emplace_back();
    stamped.header.frame_id = header.frame_id;
    stamped.header.stamp.fromSec(pose->stamp_s);
    stamped.pose = toPoseMsg(T_world_camera);
  }
  return path;
}

std::vector<TrajectoryPoint> TrajectoryLog::points(int length) const {
  std::vector<TrajectoryPoint> points;
  for (auto pose = lastPoses(length); pose != poses_.end(); ++pose)
    points.push_back({pose->position_world, pose->position_covariance});
  return points;
}

void TrajectoryLog::save(const std::string& path) const {
  const std::string partial = path + ".part";
  const auto fail = [&](const char* what) {
    const std::string cause = std::strerror(errno);
    std::remove(partial.c_str());
    throw std::runtime_error("can't " + std::string(what) + " '" + path + "': " + cause);
  };
  std::FILE* file = std::fopen(partial.c_str(), "w");
  if (!file) fail("open");
  bool written = true;
  for (const Pose& pose : poses_) {
    const Eigen::Vector3d& p = pose.position_world;
    const Eigen::Quaterniond& q = pose.q_world_camera;
    written &= std::fprintf(file, "%.9f %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", pose.stamp_s, p.x(),
                            p.y(), p.z(), q.x(), q.y(), q.z(), q.w()) > 0;
  }
  written &= std::fclose(file) == 0;
  if (!written) fail("write");
  if (std::rename(partial.c_str(), path.c_str()) != 0) fail("write");
}

}  // namespace active_matching_slam
