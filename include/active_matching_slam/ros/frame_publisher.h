#pragma once

#include <image_transport/image_transport.h>
#include <ros/ros.h>

#include <cstdint>
#include <optional>
#include <string>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/ros/markers.h"
#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "active_matching_slam/ros/trajectory_log.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// What belongs to a frame besides the frame itself.
struct FrameContext {
  ros::Time stamp;  ///< of the image, to the nanosecond
  std::string camera_frame;
  std::string body_frame;  ///< child of ~odometry
  /// Pose and twist of camera and body in the world; empty when no pose is claimed (the body's also
  /// when tf does not know where it is).
  std::optional<RigidBodyState> camera, body;
  std::uint64_t dropped_images = 0;
};

/// The topics of the node, save /tf and /diagnostics. What nobody listens to is not computed. One
/// thread at a time.
///
/// Publishes ~state (latched), ~pose, ~odometry, ~path, ~map, ~features, ~statistics, ~hypotheses,
/// ~mutual_information, ~submaps, ~markers/features, ~markers/mutual_information, ~markers/submaps,
/// ~markers/camera, ~debug_image.
class FramePublisher {
 public:
  FramePublisher(const ros::NodeHandle& private_node, const NodeOptions& options);

  void setOptions(const NodeOptions& options) { options_ = options; }
  /// The map before is gone: viewers forget it.
  void restart();

  bool wantsTrace() const;
  bool wantsStructure() const;

  void publishState(const TrackedFrame& frame, const ros::Time& stamp,
                    const std::string& motion_fault = {});
  /// Everything else.
  void publish(const TrackedFrame& frame, const FrameContext& context,
               const CameraCalibration& calibration, const TrajectoryLog& trajectory);

 private:
  /// A marker topic and what its viewers hold.
  struct MarkerTopic {
    ros::Publisher publisher;
    MarkerHistory history;
    std::uint32_t viewers = 0;
    template <class Make>
    void publish(const std_msgs::Header& header, Make make);
  };

  void publishPose(const FrameContext& context, const TrajectoryLog& trajectory);
  void publishMap(const TrackedFrame& frame, const FrameContext& context);
  void publishMarkers(const TrackedFrame& frame, const FrameContext& context,
                      const CameraCalibration& calibration, const TrajectoryLog& trajectory);
  void publishDebugImage(const TrackedFrame& frame, const FrameContext& context);
  std_msgs::Header worldHeader(const ros::Time& stamp) const;

  NodeOptions options_;
  ros::NodeHandle node_;
  image_transport::ImageTransport image_transport_;
  ros::Publisher state_, pose_, odometry_, path_, map_, features_, statistics_, hypotheses_,
      mutual_information_, submaps_;
  MarkerTopic feature_markers_, information_markers_, submap_markers_, camera_markers_;
  image_transport::Publisher debug_image_;
};

}  // namespace active_matching_slam
