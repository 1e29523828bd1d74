#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/simulation/scene.h"
#include "active_matching_slam/tracker/tracker_options.h"

namespace active_matching_slam {

/// Images of the test-bed, all in memory, at their full rate (30 Hz).
struct Sequence {
  std::string name;
  CameraModel camera;
  std::vector<cv::Mat> images{};
  std::vector<double> stamps_s{};
  Trajectory truth{};               ///< empty: unknown
  std::vector<Surface> surfaces{};  ///< what is seen, without textures; empty for a recording
  /// Unknown acceleration as fits the motion: the thesis tunes it by the sequence, too.
  double sigma_acceleration = 6.0, sigma_angular_acceleration = 10.0;

  bool isSimulated() const { return !surfaces.empty(); }
};

/// Names: office_slow, office_fast, walkway_slow, walkway_fast, walkway_straight, two_depths, wall,
/// planks, corridor, corridor_end, corridor_loop (simulated) and desk, checkerboard (recorded).
/// `quick`: half the size, and shorter.
bool isRecordedName(const std::string& name);
Sequence loadSequence(const std::string& name, const std::string& data_folder, bool quick);

/// The indices of the images that a camera of 30 / `every` Hz would take, after the first
/// `full_rate_frames`, in which the map is begun, at the full rate.
constexpr int kFullRateFrames = 40;
std::vector<int> imagesAtRate(int images, int every);

/// The first surface that a ray meets from its front: the point, or nothing.
std::optional<Eigen::Vector3d> firstHit(const std::vector<Surface>& surfaces,
                                        const Eigen::Vector3d& from,
                                        const Eigen::Vector3d& direction);

}  // namespace active_matching_slam
