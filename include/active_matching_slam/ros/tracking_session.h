#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/ros/camera_subscription.h"
#include "active_matching_slam/ros/one_camera.h"
#include "active_matching_slam/ros/repeated_warning.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// A Tracker fed with messages: makes it when the calibration is known, makes a new one when that
/// changes, and answers everything odd that may arrive with a message instead of an exception.
/// While a calibration is unusable no image is tracked, but the map waits for the old one to come
/// back. One thread at a time.
class TrackingSession {
 public:
  /// Throws std::invalid_argument, see checkTrackerOptions().
  explicit TrackingSession(const TrackerOptions& options);

  /// Which part of all images is used, until a mask comes with them; see Tracker::setMask().
  /// Without effect on a tracker that exists.
  void setMask(const cv::Mat& used) { first_mask_ = used; }
  /// A map file that the first tracker begins with.
  void setFirstMap(const std::string& path) { first_map_ = path; }

  /// Where the trackers look up the motion between images; see Tracker::setMotionHistory().
  void setMotionHistory(std::shared_ptr<const MotionHistory> history) {
    motion_history_ = std::move(history);
    if (tracker_) tracker_->setMotionHistory(motion_history_);
  }

  /// Null when the image can't be given to a tracker; fault() then says why.
  std::shared_ptr<const TrackedFrame> process(const CameraImage& image);
  /// What was wrong with the last image (calibration, encoding, stamp, size); empty: nothing.
  const std::string& fault() const { return fault_; }
  /// What is wrong with the last mask that came with an image: it is not used. Empty: nothing.
  const std::string& maskFault() const { return mask_fault_; }

  /// Null while there is no usable calibration.
  Tracker* tracker() { return tracker_.get(); }
  /// Throws std::runtime_error while there is none.
  Tracker& requireTracker();
  const CameraCalibration& calibration() const { return calibration_; }
  /// Counts the trackers made: a change means that the map before is gone.
  int generation() const { return generation_; }

  void reset(const std::string& reason);
  const TrackerOptions& options() const { return options_; }
  /// Throws std::invalid_argument and changes nothing.
  void setOptions(const TrackerOptions& options);
  /// Work that is done only while somebody looks at its results.
  void setDemand(bool trace, bool structure);

 private:
  bool updateCamera(const CameraImage& image);
  void takeCalibration(const CameraCalibration& calibration);
  void updateMask(const sensor_msgs::ImageConstPtr& mask);
  TrackerOptions demandedOptions() const;

  TrackerOptions options_;
  bool trace_demanded_ = false, structure_demanded_ = false;
  sensor_msgs::CameraInfoConstPtr info_;
  CameraCalibration calibration_;
  std::string calibration_fault_;
  std::unique_ptr<Tracker> tracker_;
  int generation_ = 0;
  std::string fault_;
  OneCamera cameras_;
  cv::Mat first_mask_;
  std::shared_ptr<const MotionHistory> motion_history_;
  sensor_msgs::ImageConstPtr mask_;
  std::string mask_fault_, first_map_;
  RepeatedWarning warning_;
};

}  // namespace active_matching_slam
