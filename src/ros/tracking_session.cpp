#include "active_matching_slam/ros/tracking_session.h"

#include <stdexcept>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/ros/image_conversions.h"

namespace active_matching_slam {

TrackingSession::TrackingSession(const TrackerOptions& options) : options_(options) {
  checkTrackerOptions(options_);
}

TrackerOptions TrackingSession::demandedOptions() const {
  TrackerOptions options = options_;
  options.matching.keep_trace = options_.matching.keep_trace || trace_demanded_;
  options.structure = options_.structure || structure_demanded_;
  options.matching.modelled_time = false;  // a node keeps up whatever machine it runs on
  return options;
}

bool TrackingSession::updateCamera(const CameraImage& image) {
  if (!image.info) {
    fault_ = "waiting for camera_info";
    return false;
  }
  if (image.info != info_) {
    info_ = image.info;
    try {
      const CameraCalibration calibration = toCalibration(*info_, image.rectified);
      for (const std::string& doubt : calibrationDoubts(*info_, calibration))
        warning_.say("This calibration can hardly be right: " + doubt);
      takeCalibration(calibration);
      calibration_fault_.clear();
    } catch (const std::exception& error) {
      calibration_fault_ = error.what();
    }
  }
  fault_ = calibration_fault_;
  return fault_.empty();
}

void TrackingSession::takeCalibration(const CameraCalibration& calibration) {
  if (tracker_ && sameImaging(calibration, calibration_)) return;
  auto tracker = std::make_unique<Tracker>(CameraModel(calibration), demandedOptions());
  try {
    tracker->setMask(first_mask_);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(std::string("mask_file: ") + error.what());
  }
  tracker->setMotionHistory(motion_history_);
  if (!first_map_.empty()) tracker->loadMap(first_map_);
  first_map_.clear();
  mask_.reset();
  if (tracker_) warning_.say("camera_info has changed: started anew with an empty map");
  tracker_ = std::move(tracker);
  calibration_ = calibration;
  ++generation_;
}

void TrackingSession::updateMask(const sensor_msgs::ImageConstPtr& mask) {
  if (!mask || mask == mask_) return;
  mask_ = mask;
  mask_fault_.clear();
  try {
    tracker_->setMask(toMask(*mask));
  } catch (const std::exception& error) {
    mask_fault_ = error.what();
  }
}

std::shared_ptr<const TrackedFrame> TrackingSession::process(const CameraImage& image) {
  fault_.clear();
  if (!updateCamera(image)) return nullptr;
  if (image.header().stamp.isZero()) {
    fault_ = "image without a stamp: ignored";
    return nullptr;
  }
  fault_ = cameras_.faultOf(image.header());
  if (!fault_.empty()) return nullptr;
  updateMask(image.mask);
  try {
    const auto frame = tracker_->track(image.toGray(), image.header().stamp.toSec());
    if (frame->image.empty()) fault_ = frame->reason;
    return frame;
  } catch (const std::runtime_error& error) {
    fault_ = error.what();
  } catch (const std::exception& error) {
    fault_ = std::string("image ignored: ") + error.what();
  }
  return nullptr;
}

Tracker& TrackingSession::requireTracker() {
  if (!tracker_)
    throw std::runtime_error("there is no map yet: " +
                             (fault_.empty() ? std::string("no image has arrived") : fault_));
  return *tracker_;
}

void TrackingSession::reset(const std::string& reason) {
  if (tracker_) tracker_->reset(reason);
}

void TrackingSession::setOptions(const TrackerOptions& options) {
  checkTrackerOptions(options);
  const TrackerOptions before = options_;
  options_ = options;
  try {
    if (tracker_) tracker_->setOptions(demandedOptions());
  } catch (const std::exception&) {
    options_ = before;
    throw;
  }
}

void TrackingSession::setDemand(bool trace, bool structure) {
  if (trace == trace_demanded_ && structure == structure_demanded_) return;
  trace_demanded_ = trace;
  structure_demanded_ = structure;
  if (tracker_) tracker_->setOptions(demandedOptions());
}

}  // namespace active_matching_slam
