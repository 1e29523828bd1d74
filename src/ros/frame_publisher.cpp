#include "active_matching_slam/ros/frame_publisher.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/visualisation/debug_image.h"

namespace active_matching_slam {
namespace {

/// What a subscriber on a busy machine may leave unread, some seconds of a camera, and still miss
/// nothing.
constexpr int kPublisherQueueSize = 100;

bool hasListener(const ros::Publisher& publisher) { return publisher.getNumSubscribers() > 0; }

template <class Make>
void publishIfSubscribed(const ros::Publisher& publisher, Make make) {
  if (hasListener(publisher)) publisher.publish(make());
}

}  // namespace

template <class Make>
void FramePublisher::MarkerTopic::publish(const std_msgs::Header& header, Make make) {
  const std::uint32_t viewers_now = publisher.getNumSubscribers();
  if (viewers_now > viewers) history.restart();
  viewers = viewers_now;
  if (viewers == 0) return;
  visualization_msgs::MarkerArray markers = make();
  history.complete(header, &markers);
  publisher.publish(markers);
}

FramePublisher::FramePublisher(const ros::NodeHandle& private_node, const NodeOptions& options)
    : options_(options), node_(private_node), image_transport_(private_node) {
  state_ = node_.advertise<ams_msgs::TrackingState>("state", kPublisherQueueSize, true);
  pose_ = node_.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", kPublisherQueueSize);
  odometry_ = node_.advertise<nav_msgs::Odometry>("odometry", kPublisherQueueSize);
  path_ = node_.advertise<nav_msgs::Path>("path", 1);
  map_ = node_.advertise<sensor_msgs::PointCloud2>("map", 1);
  features_ = node_.advertise<ams_msgs::FeatureArray>("features", kPublisherQueueSize);
  statistics_ = node_.advertise<ams_msgs::MatchingStatistics>("statistics", kPublisherQueueSize);
  hypotheses_ = node_.advertise<ams_msgs::MatchHypotheses>("hypotheses", kPublisherQueueSize);
  mutual_information_ = node_.advertise<ams_msgs::MutualInformationGraph>("mutual_information", 1);
  submaps_ = node_.advertise<ams_msgs::SubmapHierarchy>("submaps", 1);
  const auto advertiseMarkers = [&](const std::string& name) {
    return node_.advertise<visualization_msgs::MarkerArray>("markers/" + name, 1);
  };
  feature_markers_.publisher = advertiseMarkers("features");
  information_markers_.publisher = advertiseMarkers("mutual_information");
  submap_markers_.publisher = advertiseMarkers("submaps");
  camera_markers_.publisher = advertiseMarkers("camera");
  debug_image_ = image_transport_.advertise("debug_image", 1);

  TrackedFrame waiting;
  waiting.reason = "no image yet";
  publishState(waiting, ros::Time());
}

void FramePublisher::restart() {
  for (MarkerTopic* topic :
       {&feature_markers_, &information_markers_, &submap_markers_, &camera_markers_})
    topic->history.restart();
}

bool FramePublisher::wantsTrace() const {
  return debug_image_.getNumSubscribers() > 0 && (options_.draw.searches || options_.draw.matches);
}

bool FramePublisher::wantsStructure() const {
  const bool drawn = options_.draw.links || options_.draw.submaps || options_.draw.tree;
  return (drawn && debug_image_.getNumSubscribers() > 0) || hasListener(mutual_information_) ||
         hasListener(submaps_) || hasListener(information_markers_.publisher) ||
         hasListener(submap_markers_.publisher);
}

std_msgs::Header FramePublisher::worldHeader(const ros::Time& stamp) const {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = options_.world_frame;
  return header;
}

void FramePublisher::publishState(const TrackedFrame& frame, const ros::Time& stamp,
                                  const std::string& motion_fault) {
  ams_msgs::TrackingState message = toTrackingStateMsg(frame, worldHeader(stamp));
  if (!motion_fault.empty()) message.motion_fault = motion_fault;
  state_.publish(message);
}

void FramePublisher::publish(const TrackedFrame& frame, const FrameContext& context,
                             const CameraCalibration& calibration,
                             const TrajectoryLog& trajectory) {
  if (context.camera) publishPose(context, trajectory);
  publishMap(frame, context);
  publishMarkers(frame, context, calibration, trajectory);
  publishDebugImage(frame, context);
}

void FramePublisher::publishPose(const FrameContext& context, const TrajectoryLog& trajectory) {
  const std_msgs::Header header = worldHeader(context.stamp);
  publishIfSubscribed(pose_, [&] { return toPoseWithCovarianceMsg(*context.camera, header); });
  if (context.body)
    publishIfSubscribed(odometry_,
                        [&] { return toOdometryMsg(*context.body, header, context.body_frame); });
  publishIfSubscribed(path_, [&] { return trajectory.path(options_.path_length, header); });
}

void FramePublisher::publishMap(const TrackedFrame& frame, const FrameContext& context) {
  const std_msgs::Header world = worldHeader(context.stamp);
  std_msgs::Header camera = world;
  camera.frame_id = context.camera_frame;
  const int level = options_.submap_level;
  publishIfSubscribed(map_, [&] { return toPointCloudMsg(frame, level, world); });
  publishIfSubscribed(features_, [&] { return toFeatureArrayMsg(frame, level, world); });
  publishIfSubscribed(statistics_,
                      [&] { return toStatisticsMsg(frame, context.dropped_images, camera); });
  publishIfSubscribed(hypotheses_, [&] { return toHypothesesMsg(frame, camera); });
  publishIfSubscribed(mutual_information_, [&] { return toGraphMsg(frame, world); });
  publishIfSubscribed(submaps_, [&] { return toSubmapsMsg(frame, world); });
}

void FramePublisher::publishMarkers(const TrackedFrame& frame, const FrameContext& context,
                                    const CameraCalibration& calibration,
                                    const TrajectoryLog& trajectory) {
  const std_msgs::Header header = worldHeader(context.stamp);
  feature_markers_.publish(header, [&] { return featureMarkers(frame, header); });
  information_markers_.publish(header,
                               [&] { return informationMarkers(frame, options_.draw, header); });
  submap_markers_.publish(header,
                          [&] { return submapMarkers(frame, options_.submap_level, header); });
  camera_markers_.publish(header, [&] {
    return cameraMarkers(frame, calibration, trajectory.points(options_.path_length),
                         options_.draw.frustum_m, header);
  });
}

void FramePublisher::publishDebugImage(const TrackedFrame& frame, const FrameContext& context) {
  if (debug_image_.getNumSubscribers() == 0) return;
  cv_bridge::CvImage image;
  image.header.stamp = context.stamp;
  image.header.frame_id = context.camera_frame;
  image.encoding = sensor_msgs::image_encodings::BGR8;
  image.image = drawDebugImage(frame, options_.draw, options_.submap_level);
  if (!image.image.empty()) debug_image_.publish(image.toImageMsg());
}

}  // namespace active_matching_slam
