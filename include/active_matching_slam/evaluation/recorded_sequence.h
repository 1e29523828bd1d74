#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"

namespace active_matching_slam {

/// A recorded sequence in a folder: camera.yaml (as camera_info), times.txt ("seconds file" a line,
/// '#' begins a comment), and the files named there or, in their place, video.mp4.
class RecordedSequence {
 public:
  /// Only the first of every `every` images is delivered. Throws std::runtime_error naming a file
  /// that can't be read, std::invalid_argument when `every` is less than 1.
  explicit RecordedSequence(const std::string& folder, int every = 1);

  const CameraModel& camera() const { return camera_; }
  int size() const { return static_cast<int>(stamps_.size()); }  ///< of the whole recording

  /// Calls f(8-bit grey image, stamp in seconds) until it returns false. Throws std::runtime_error
  /// naming an image that can't be read.
  void forEachFrame(const std::function<bool(const cv::Mat&, double)>& f) const;

 private:
  std::string folder_;
  int every_;
  CameraModel camera_;
  std::vector<double> stamps_;
  std::vector<std::string> files_;
};

}  // namespace active_matching_slam
