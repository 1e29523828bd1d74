#include "active_matching_slam/ros/tracker_ros.h"

#include <XmlRpcValue.h>

#include <functional>
#include <stdexcept>

#include "active_matching_slam/image/image_mask.h"
#include "active_matching_slam/ros/bound_options.h"
#include "active_matching_slam/ros/frame_name.h"
#include "active_matching_slam/ros/image_conversions.h"

namespace active_matching_slam {
namespace {

constexpr const char* kShuttingDown = "the tracker is shutting down";
/// Masks that may lie unread. Cost: as CameraSubscription's, memory for so many pictures.
constexpr int kMaskQueueSize = 50;

}  // namespace

NodeSettings readNodeSettings(const ros::NodeHandle& private_node) {
  NodeSettings settings;
  XmlRpc::XmlRpcValue tree;
  private_node.getParam(private_node.getNamespace(), tree);
  readParameterTree(bindOptions(&settings.tracker, &settings.node), tree,
                    private_node.getNamespace() + "/");
  if (!settings.node.known_target.empty())
    readKnownTargetYaml(settings.node.known_target, &settings.tracker);
  checkTrackerOptions(settings.tracker);
  checkNodeOptions(settings.node);
  return settings;
}

TrackerRos::TrackerRos(const ros::NodeHandle& private_node)
    : private_node_(private_node),
      settings_(readNodeSettings(private_node)),
      data_directory_(settings_.node.data_directory),
      diagnostics_(private_node),
      options_(settings_.node),
      session_(settings_.tracker),
      publisher_(private_node, settings_.node),
      broadcaster_(settings_.node),
      trajectory_(settings_.node.trajectory_length) {
  if (!options_.mask_file.empty()) session_.setMask(readMask(options_.mask_file));
  if (!options_.first_map.empty())
    session_.setFirstMap(data_directory_.resolve(options_.first_map));
  motion_ = std::make_unique<MotionSubscription>(private_node, settings_.tracker.motion);
  session_.setMotionHistory(motion_->history());
  worker_ = std::make_unique<FrameWorker<CameraImage>>(
      [this](const CameraImage& image) { process(image); });
  subscription_ = std::make_unique<CameraSubscription>(private_node, options_.camera_info_url,
                                                       options_.no_image_timeout_s);
  masked_images_ =
      std::make_unique<MaskedImages>([this](const CameraImage& image) { worker_->post(image); });
  subscribeBeside();
  subscription_->start(options_.image_transport,
                       [this](const CameraImage& image) { masked_images_->addImage(image); });
  diagnostics_.start([this] {
    return NodeDiagnostics::Images{subscription_->received(), worker_->dropped(),
                                   subscription_->silence(), subscription_->imageTopic()};
  });
  reconfigure_ = std::make_unique<ReconfigureServer>(
      private_node_, [this] { return bindOptions(&settings_.tracker, &settings_.node); },
      [this](const std::vector<ReconfigureServer::Change>& changes) {
        return applyChanges(changes);
      });
  advertiseServices();
  const std::string scale =
      settings_.tracker.motion.hasOdometry() ? "scale comes from " + motion_->topic()
      : settings_.tracker.ground.isKnown()   ? "scale comes from camera_height_m"
      : settings_.node.known_target.empty()
          ? "scale is free: lengths are in map units until ~set_scale, or start from a known_target"
          : "scale comes from " + settings_.node.known_target;
  ROS_INFO_STREAM("Tracking images of " << subscription_->imageTopic() << " with "
                                        << subscription_->infoTopic()
                                        << (isRectifiedTopic(subscription_->imageTopic())
                                                ? " (rectified: its P, no distortion)"
                                                : "")
                                        << "; " << scale);
  if (!settings_.tracker.mapping &&
      (settings_.tracker.ground.isKnown() || !settings_.node.known_target.empty()))
    ROS_WARN(
        "mapping is false: lengths are those of the loaded map, known_target and "
        "camera_height_m are not used");
}

// A nodelet's callbacks run in other threads. Each source of them ends before what it asks.
TrackerRos::~TrackerRos() {
  diagnostics_.stop();
  services_.clear();
  reconfigure_.reset();
  mask_.shutdown();
  initial_pose_.shutdown();
  subscription_.reset();
  worker_->stop();
  motion_.reset();
}

void TrackerRos::process(const CameraImage& image) noexcept {
  try {
    track(image);
  } catch (const std::exception& error) {
    diagnostics_.recordFault(error.what());
    warning_.say(subscription_->imageTopic() + ": " + error.what());
  }
}

void TrackerRos::track(const CameraImage& image) {
  motion_->collect(image.header().stamp, cameraFrame(image.header()));
  session_.setDemand(publisher_.wantsTrace(), publisher_.wantsStructure());
  const auto frame = session_.process(image);
  if (!session_.fault().empty()) {
    diagnostics_.recordFault(session_.fault());
    // That camera_info is missing the subscription says itself.
    if (image.info) warning_.say(subscription_->imageTopic() + ": " + session_.fault());
  }
  if (!session_.maskFault().empty()) {
    diagnostics_.recordFault(session_.maskFault());
    warning_.say(private_node_.resolveName("mask") + " is not used: " + session_.maskFault());
  }
  if (!frame) {
    TrackedFrame told;
    if (last_frame_) told = *last_frame_;
    told.state = state_;
    told.reason = session_.fault();
    publisher_.publishState(told, image.header().stamp);
    return;
  }
  last_frame_ = frame;
  noticeChanges(*frame, image.header().stamp);
  noticeScale(*frame);
  noticeImageFixed(*frame);
  publisher_.publishState(*frame, image.header().stamp, noticeMotion(*frame));
  if (!session_.fault().empty()) return;
  publish(*frame, image);
  diagnostics_.record(*frame, (ros::Time::now() - image.header().stamp).toSec(),
                      (ros::WallTime::now() - image.received).toSec());
}

void TrackerRos::publish(const TrackedFrame& frame, const CameraImage& image) {
  FrameContext context;
  context.stamp = image.header().stamp;
  camera_frame_ = context.camera_frame = cameraFrame(image.header());
  context.body_frame = options_.base_frame.empty() ? context.camera_frame : options_.base_frame;
  context.dropped_images = worker_->dropped();
  if (frame.rescaled_by != 1.0) trajectory_.rescale(frame.rescaled_by);
  if (frame.state == TrackingState::kTracking) {
    trajectory_.add(frame);
    context.camera =
        rigidBodyState(frame.camera, frame.camera_covariance, Eigen::Isometry3d::Identity());
    const auto T_camera_base = broadcaster_.cameraFromBase(context.camera_frame, context.stamp);
    if (T_camera_base) {
      context.body = rigidBodyState(frame.camera, frame.camera_covariance, *T_camera_base);
      broadcaster_.send(frame, context.camera_frame, context.stamp, *T_camera_base);
    }
  }
  publisher_.publish(frame, context, session_.calibration(), trajectory_);
}

void TrackerRos::noticeChanges(const TrackedFrame& frame, const ros::Time& stamp) {
  const bool time_jumped = frame.stamp_s < last_stamp_s_;
  if (session_.generation() != generation_ || frame.resets != resets_ || frame.map != map_) {
    if (time_jumped)
      restart_warning_.say("time", "Time ran back by " +
                                       std::to_string(last_stamp_s_ - frame.stamp_s) +
                                       " s (a looped bag?): started anew");
    else if (frame.resets == resets_ && session_.generation() == generation_)
      ROS_WARN_STREAM("The pose is in map " << frame.map << " from here on: " << frame.reason);
    else if (session_.generation() == generation_ && reset_cause_.empty())
      restart_warning_.say(std::string("Started anew") + (frame.reason.empty() ? "" : ": ") +
                           frame.reason.substr(0, frame.reason.find(": started anew")));
    forgetPast(time_jumped);
  }
  generation_ = session_.generation();
  resets_ = frame.resets;
  map_ = frame.map;
  reset_cause_.clear();
  last_stamp_s_ = stamp.toSec();
  if (frame.state == state_) return;
  state_ = frame.state;
  const std::string because = frame.reason.empty() ? "" : ": " + frame.reason;
  if (state_ == TrackingState::kTracking)
    ROS_INFO_STREAM("Tracking; scale: " << scaleSourceName(frame.scale_source));
  else
    ROS_WARN_STREAM("State: " << trackingStateName(state_) << because);
}

/// Says once each what is wrong with odometry, or IMU, and that it is back. Returns what is wrong.
std::string TrackerRos::noticeMotion(const TrackedFrame& frame) {
  if (!motion_->isOn()) return {};
  const bool is_told = !frame.motion_source.empty();
  std::string fault = motion_->fault();
  if (fault.empty() && !frame.motion_fault.empty())
    fault = motion_->topic() + ": " + frame.motion_fault;
  diagnostics_.recordMotion(motion_->topic(), fault, is_told);
  if (is_told && !is_motion_told_) {
    ROS_INFO_STREAM(motion_->topic() << ": is used again");
    motion_warning_.forget();
  }
  if (is_told || !fault.empty()) is_motion_told_ = is_told;
  // What has stopped is at fault in several ways one after the other.
  if (!fault.empty() && (motion_->hasCome() || !motion_warning_.hasSaid()))
    motion_warning_.say(is_told ? fault : fault + "; constant velocity is assumed until it comes");
  return fault;
}

/// What lengths are, when that changes, and once what was refused as their source.
void TrackerRos::noticeScale(const TrackedFrame& frame) {
  if (frame.rescaled_by != 1.0)
    ROS_INFO_STREAM("The map is metric from here on, by " << scaleSourceName(frame.scale_source)
                                                          << "; its scale is known to "
                                                          << 100.0 * frame.scale_sigma << " %");
  if (!frame.scale_fault.empty()) scale_warning_.say(frame.scale_fault);
}

void TrackerRos::noticeImageFixed(const TrackedFrame& frame) {
  if (frame.image_fixed > 0.0) image_fixed_warning_.say(imageFixedMessage(frame.image_fixed));
}

void TrackerRos::forgetPast(bool time_jumped) {
  motion_warning_.forget();
  scale_warning_.forget();
  trajectory_.clear();
  publisher_.restart();
  broadcaster_.reset(time_jumped);
}

std::string TrackerRos::cameraFrame(const std_msgs::Header& header) const {
  if (!options_.camera_frame.empty()) return options_.camera_frame;
  const std::string frame = withoutLeadingSlash(header.frame_id);
  if (!frame.empty() && frame != options_.world_frame) return frame;
  ROS_WARN_STREAM_ONCE("The images' frame_id '" << header.frame_id
                                                << "' can't name the camera: using 'camera' (set "
                                                   "camera_frame)");
  return "camera";
}

void TrackerRos::subscribeBeside() {
  const boost::function<void(const sensor_msgs::ImageConstPtr&)> take_mask =
      [this](const sensor_msgs::ImageConstPtr& mask) { masked_images_->addMask(mask); };
  mask_ = private_node_.subscribe<sensor_msgs::Image>("mask", kMaskQueueSize, take_mask);
  // Beside the node, as the images are, where rviz publishes it.
  initial_pose_ = private_node_.subscribe(
      ros::names::append(ros::names::parentNamespace(private_node_.getNamespace()), "initialpose"),
      1, &TrackerRos::onInitialPose, this);
}

void TrackerRos::onInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  try {
    worker_->call([&] { setPose(message); });
  } catch (const std::exception& error) {
    ROS_WARN_STREAM("initialpose: refused: " << error.what());
  }
}

/// In the worker's thread.
void TrackerRos::setPose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const UncertainPose given = fromPoseWithCovarianceMsg(message.pose);
  const UncertainPose camera = broadcaster_.cameraOf(given, message.header.frame_id, camera_frame_);
  session_.requireTracker().setPose(camera.T_parent_child, camera.covariance);
  ROS_INFO("initialpose: looking for the camera there");
}

void TrackerRos::advertiseServices() {
  services_ = {
      private_node_.advertiseService("reset", &TrackerRos::onReset, this),
      private_node_.advertiseService("save_map", &TrackerRos::onSaveMap, this),
      private_node_.advertiseService("load_map", &TrackerRos::onLoadMap, this),
      private_node_.advertiseService("save_trajectory", &TrackerRos::onSaveTrajectory, this),
      private_node_.advertiseService("set_scale", &TrackerRos::onSetScale, this),
      private_node_.advertiseService("set_matcher", &TrackerRos::onSetMatcher, this)};
}

std::string TrackerRos::applyChanges(const std::vector<ReconfigureServer::Change>& changes) {
  NodeSettings next = settings_;
  const std::vector<BoundOption> options = bindOptions(&next.tracker, &next.node);
  try {
    for (const auto& change : changes)
      for (const BoundOption& option : options)
        if (option.name() == change.name) option.set(change.value);
    checkNodeOptions(next.node);
    const bool is_done = worker_->call([&] {
      session_.setOptions(next.tracker);
      motion_->setOptions(next.tracker.motion);
      options_ = next.node;
      publisher_.setOptions(next.node);
      broadcaster_.setOptions(next.node);
    });
    if (!is_done) return kShuttingDown;
  } catch (const std::exception& fault) {
    return fault.what();
  }
  settings_ = next;
  subscription_->setSilenceTimeout(next.node.no_image_timeout_s);
  return {};
}

template <class Response>
bool TrackerRos::answer(Response& response, const std::function<void()>& task) {
  try {
    response.success = worker_->call(task);
    if (!response.success) response.message = kShuttingDown;
  } catch (const std::exception& error) {
    response.success = false;
    response.message = error.what();
    ROS_WARN_STREAM("Refused: " << error.what());
  }
  return true;
}

bool TrackerRos::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [&] {
    reset_cause_ = "asked for by ~reset";
    session_.reset(reset_cause_);
    forgetPast(false);
    response.message = "the next image starts anew";
  });
}

bool TrackerRos::onSaveMap(ams_msgs::SaveMap::Request& request,
                           ams_msgs::SaveMap::Response& response) {
  return answer(response, [&] {
    const std::string path = data_directory_.resolve(request.name);
    data_directory_.create();
    session_.requireTracker().saveMap(path);
    response.message = path;
  });
}

bool TrackerRos::onLoadMap(ams_msgs::LoadMap::Request& request,
                           ams_msgs::LoadMap::Response& response) {
  return answer(response, [&] {
    const std::string path = data_directory_.resolve(request.name);
    session_.requireTracker().loadMap(path);
    reset_cause_ = "a map was loaded";
    forgetPast(false);
    response.message = path;
  });
}

bool TrackerRos::onSaveTrajectory(ams_msgs::SaveTrajectory::Request& request,
                                  ams_msgs::SaveTrajectory::Response& response) {
  return answer(response, [&] {
    const std::string path = data_directory_.resolve(request.name);
    data_directory_.create();
    trajectory_.save(path);
    response.poses = trajectory_.size();
    response.message = path;
  });
}

bool TrackerRos::onSetScale(ams_msgs::SetScale::Request& request,
                            ams_msgs::SetScale::Response& response) {
  return answer(response, [&] {
    session_.requireTracker().setScale(request.factor);
    trajectory_.rescale(request.factor);
    response.message = "all lengths were multiplied by " + std::to_string(request.factor);
  });
}

bool TrackerRos::onSetMatcher(ams_msgs::SetMatcher::Request& request,
                              ams_msgs::SetMatcher::Response& response) {
  const std::string error = applyChanges({{"matcher", request.name}});
  response.success = error.empty();
  response.message = error.empty() ? request.name : error;
  if (error.empty())
    reconfigure_->publishUpdate();
  else
    ROS_WARN_STREAM("Refused: " << error);
  return true;
}

}  // namespace active_matching_slam
