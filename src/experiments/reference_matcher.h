#pragma once

#include <Eigen/Geometry>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/template.h"
#include "active_matching_slam/tracker/tracked_frame.h"
#include "sequence.h"

namespace active_matching_slam {

/// A camera pose from points and their pixels.
struct PnpPose {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<int> inliers;  ///< ascending
};

/// OpenCV's RANSAC PnP through the lens model, refined over the inliers within `inlier_px`. Empty
/// with fewer than 6 of them.
std::optional<PnpPose> solvePnp(const CameraModel& camera,
                                const std::vector<Eigen::Vector3d>& points_world,
                                const std::vector<Eigen::Vector2d>& pixels, double inlier_px);

/// Where features are in a recording, by other means than those under test (Chli 2009,
/// section 7.6): dense optical flow from the image before carries that frame's matches over, a pose
/// follows from them and the positions that the run ended with, and the reference is the best
/// correlation in a small window around each feature's projection.
class ReferenceMatcher {
 public:
  explicit ReferenceMatcher(const Sequence& sequence) : sequence_(sequence) {}
  /// To be shown every frame of the run, in order.
  void observe(const TrackedFrame& frame, int image);
  /// Once the run is over: the place of each feature; NaN where there is no sure one [px].
  std::vector<Eigen::Vector2d> match(int image, const std::vector<FeatureId>& ids,
                                     const std::vector<Template>& templates) const;

 private:
  struct Observed {
    int image_before = -1;
    std::map<FeatureId, Eigen::Vector2d> pixel_before;
  };
  std::optional<Eigen::Isometry3d> poseByFlow(const Observed& observed, int image) const;

  const Sequence& sequence_;
  std::map<int, Observed> observed_;  ///< by image
  Observed last_;
  std::map<FeatureId, Eigen::Vector3d> position_;  ///< the last, of features of known depth
};

}  // namespace active_matching_slam
