#pragma once

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/tracked_frame.h"

namespace active_matching_slam {

/// The region within 3 standard deviations: half the lengths of its axes, and its orientation.
struct Ellipsoid {
  Eigen::Vector3d semi_axes_m;  ///< 3 times the roots of the eigenvalues
  Eigen::Quaterniond q_world_axes;
};
/// Negative eigenvalues (rounding) count as zero.
Ellipsoid threeSigmaEllipsoid(const Eigen::Matrix3d& covariance);

/// Depths along an inverse-depth feature's ray within 3 sigma; the far end is cut at `limit_m`.
std::pair<double, double> threeSigmaDepths(double inverse_depth, double sigma_inverse_depth,
                                           double limit_m);

/// Where the camera was, with the covariance of that position.
struct TrajectoryPoint {
  Eigen::Vector3d position_world;
  Eigen::Matrix3d covariance_world;
};

// Everything below lives in the frame of the header. Colours of features: green matched, orange
// rejected, red missed, blue not visible or not searched, white known.

/// Points, 3-sigma ellipsoids; inverse-depth features as the 3-sigma interval of their ray. What
/// was laid aside in the colours of its submaps, and the separators by which these hang on the map.
visualization_msgs::MarkerArray featureMarkers(const TrackedFrame& frame,
                                               const std_msgs::Header& header);
/// linksToShow(), width and colour by bits; the tree in gold on top.
visualization_msgs::MarkerArray informationMarkers(const TrackedFrame& frame,
                                                   const DrawOptions& options,
                                                   const std_msgs::Header& header);
/// Features and tree links in the colour of their submap at `level`, with hulls and labels.
visualization_msgs::MarkerArray submapMarkers(const TrackedFrame& frame, int level,
                                              const std_msgs::Header& header);
/// Frustum at the present pose (left out unless the state is kTracking), trajectory, and ellipsoids
/// of its 3-sigma.
visualization_msgs::MarkerArray cameraMarkers(const TrackedFrame& frame,
                                              const CameraCalibration& calibration,
                                              const std::vector<TrajectoryPoint>& trajectory,
                                              double frustum_m, const std_msgs::Header& header);

/// Remembers what a topic's viewers hold, so that markers that are no more get deleted.
class MarkerHistory {
 public:
  /// So often is a deletion repeated: a viewer that is busy drawing misses messages.
  static constexpr std::int64_t kDeletionRepeats = 100;

  /// Appends a deletion for each marker of the last kDeletionRepeats messages that is not among
  /// these; begins with a deletion of all after restart(), which also serves a viewer that joins
  /// late. Deletions carry the header too: a message has one stamp, whatever it says.
  void complete(const std_msgs::Header& header, visualization_msgs::MarkerArray* markers);
  void restart() { restart_ = true; }

 private:
  std::map<std::pair<std::string, int>, std::int64_t> last_shown_;  ///< number of the message
  std::int64_t message_ = 0;
  bool restart_ = true;
};

}  // namespace active_matching_slam
