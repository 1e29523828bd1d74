#include "active_matching_slam/ros/motion_subscription.h"

#include <chrono>
#include <stdexcept>
#include <utility>

#include "active_matching_slam/ros/frame_name.h"
#include "active_matching_slam/ros/motion_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {
namespace {

/// Of a second of a fast IMU. Cost: memory.
constexpr int kMotionQueueSize = 1000;

}  // namespace

MotionSubscription::MotionSubscription(const ros::NodeHandle& private_node,
                                       const MotionOptions& options)
    : options_(options) {
  if (!options.hasOdometry() && !options.hasGyro()) return;
  history_ = std::make_shared<MotionHistory>(options);
  buffer_ = std::make_unique<tf2_ros::Buffer>();
  listener_ = std::make_unique<tf2_ros::TransformListener>(*buffer_);
  ros::NodeHandle node = private_node;
  topic_ =
      node.resolveName(ros::names::append(ros::names::parentNamespace(private_node.getNamespace()),
                                          options.hasGyro() ? "imu" : "odometry"));
  const auto hints = ros::TransportHints().tcpNoDelay();
  subscriber_ =
      options.hasGyro()
          ? node.subscribe(topic_, kMotionQueueSize, &MotionSubscription::onImu, this, hints)
          : node.subscribe(topic_, kMotionQueueSize, &MotionSubscription::onOdometry, this, hints);
}

MotionSubscription::~MotionSubscription() { subscriber_.shutdown(); }

void MotionSubscription::setOptions(const MotionOptions& options) {
  options_ = options;
  if (history_) history_->setOptions(options);
}

void MotionSubscription::received() {
  last_arrival_ = ros::WallTime::now();
  arrival_.notify_one();
}

void MotionSubscription::onOdometry(const nav_msgs::OdometryConstPtr& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  odometry_.push_back(message);
  if (odometry_.size() > kMotionQueueSize) odometry_.pop_front();
  received();
}

void MotionSubscription::onImu(const sensor_msgs::ImuConstPtr& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  imu_.push_back(message);
  if (imu_.size() > kMotionQueueSize) imu_.pop_front();
  received();
}

void MotionSubscription::takeIn() {
  std::deque<nav_msgs::OdometryConstPtr> odometry;
  std::deque<sensor_msgs::ImuConstPtr> imu;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    odometry.swap(odometry_);
    imu.swap(imu_);
  }
  has_come_ |= !odometry.empty() || !imu.empty();
  const auto add = [&](const std_msgs::Header& header, const std::string& frame, auto&& sampleOf) {
    base_frame_ = withoutLeadingSlash(frame);
    std::string wrong;
    try {
      if (header.stamp.isZero()) throw std::invalid_argument("without a stamp: left out");
      wrong = history_->add(sampleOf());
    } catch (const std::invalid_argument& error) {
      wrong = error.what();
    }
    if (wrong.empty()) return;
    fault_ = topic_ + ": a message is at fault: " + wrong;
  };
  for (const auto& message : odometry)
    add(message->header, message->child_frame_id, [&] { return fromOdometryMsg(*message); });
  for (const auto& message : imu)
    add(message->header, message->header.frame_id, [&] { return fromImuMsg(*message); });
}

/// Where the camera is on the robot: looked for until tf knows it.
void MotionSubscription::findCamera(const std::string& camera_frame) {
  if (base_frame_.empty() && history_->newest_s() < 0.0) return;  // nothing has come
  const std::string pair = base_frame_ + " " + camera_frame;
  if (history_->hasCamera() && pair == camera_frame_) return;
  try {
    const Eigen::Isometry3d T_base_camera =
        base_frame_ == camera_frame
            ? Eigen::Isometry3d::Identity()
            : fromTransformMsg(
                  buffer_->lookupTransform(base_frame_, camera_frame, ros::Time(0)).transform);
    history_->setCamera(T_base_camera);
    camera_frame_ = pair;
    ROS_INFO_STREAM(topic_ << ": the motion of '" << base_frame_ << "', on which '" << camera_frame
                           << "' is at [" << T_base_camera.translation().transpose() << "] m");
  } catch (const tf2::TransformException& error) {
    history_->forgetCamera();
    fault_ = topic_ + ": is not used: tf has no transform from '" + base_frame_ +
             "', whose motion it is, to the camera '" + camera_frame + "': " + error.what();
  }
}

void MotionSubscription::collect(const ros::Time& stamp, const std::string& camera_frame) {
  if (!history_) return;
  fault_.clear();
  has_come_ = false;
  takeIn();
  const ros::WallTime begin = ros::WallTime::now();
  const double timeout_s = options_.odometry_timeout_s;
  while (true) {
    // Where nothing comes, or what comes is of another time, there is nothing to wait for.
    const double missing_s = stamp.toSec() - history_->newest_s();
    const double left_s = timeout_s - (ros::WallTime::now() - begin).toSec();
    std::unique_lock<std::mutex> lock(mutex_);
    const bool is_silent = (ros::WallTime::now() - last_arrival_).toSec() > timeout_s;
    if (missing_s <= 0.0 || missing_s > timeout_s || left_s <= 0.0 || is_silent) break;
    arrival_.wait_for(lock, std::chrono::duration<double>(left_s),
                      [this] { return !odometry_.empty() || !imu_.empty(); });
    lock.unlock();
    takeIn();
  }
  findCamera(camera_frame);
}

}  // namespace active_matching_slam
