#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/tracker/motion_history.h"
#include "active_matching_slam/tracker/tracked_frame.h"
#include "active_matching_slam/tracker/tracker_options.h"

namespace active_matching_slam {

/// One image in, one TrackedFrame out. Not thread-safe: one thread at a time.
class Tracker {
 public:
  /// Throws std::invalid_argument, see checkTrackerOptions().
  Tracker(const CameraModel& camera, const TrackerOptions& options);
  ~Tracker();

  /// `image`: 8-bit grey of the camera's size. `stamp_s`: acquisition time. Bad input (wrong size
  /// or type, empty, a stamp that is not later than the last, not finite) never throws: nothing is
  /// changed and the frame's `reason` says what was wrong; a stamp that runs back by more than a
  /// second resets the tracker. `fault`: why there is no image, when it is empty.
  std::shared_ptr<const TrackedFrame> track(const cv::Mat& image, double stamp_s,
                                            const std::string& fault = "");

  /// Which part of the images from the next one on shows the scene: 8-bit grey of the camera's
  /// size, white is used. Empty: all. Throws std::invalid_argument naming what is wrong with it.
  void setMask(const cv::Mat& used);

  /// Where the motion between images is looked up, as TrackerOptions::motion says; null: nowhere.
  void setMotionHistory(std::shared_ptr<const MotionHistory> history);

  /// Empties the map, and the next image starts anew; without mapping looks for the camera anew.
  void reset(const std::string& reason);

  const TrackerOptions& options() const;
  /// Changes settings without losing the map. Throws std::invalid_argument and changes nothing.
  void setOptions(const TrackerOptions& options);

  /// Multiplies all lengths by `factor` > 0; the scale source becomes kService.
  void setScale(double factor);

  /// Whole state, written atomically; throws std::runtime_error naming file and cause.
  void saveMap(const std::string& path) const;
  /// Replaces the map and looks for the camera in it; on any fault throws std::runtime_error and
  /// changes nothing.
  void loadMap(const std::string& path);

  /// The camera is somewhere near `T_world_camera`: it is looked for there. `covariance` of
  /// position and rotation in CameraError order. Until it is found no pose is claimed. Throws
  /// std::runtime_error without a map, std::invalid_argument for numbers that are no pose or no
  /// covariance.
  void setPose(const Eigen::Isometry3d& T_world_camera,
               const Eigen::Matrix<double, 6, 6>& covariance);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace active_matching_slam
