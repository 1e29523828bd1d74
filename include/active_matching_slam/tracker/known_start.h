#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/tracker/tracker_options.h"

namespace active_matching_slam {

/// Where the known points were found in an image, and the camera from them.
struct KnownStart {
  Eigen::Isometry3d T_world_camera;     ///< the points' frame is the world
  std::vector<Eigen::Vector2d> pixels;  ///< one a point [px]
  double reprojection_rms_px = 0.0;
};

/// Searches every known point within `search_px` of where it is expected (its template by
/// correlation; without one, the corners there), and takes the combination of responses that a
/// single camera explains best. Empty, with the cause in `reason`, when a point has no response or
/// no camera explains them within 2 px.
std::optional<KnownStart> findKnownStart(const cv::Mat& image, const CameraModel& camera,
                                         const std::vector<KnownPoint>& points, double search_px,
                                         const ImageOptions& options, std::string* reason);

}  // namespace active_matching_slam
