#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// Delivers the images of a recording, one after the other.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  /// False at the end. `image`: 8-bit grey. May throw what its recording makes it throw.
  virtual bool next(cv::Mat* image, double* stamp_s) = 0;
  /// Why the image delivered last is empty; empty when it is not.
  virtual std::string fault() const { return ""; }
  /// Steps over one image without decoding it; false at the end.
  virtual bool skip() = 0;
};

struct RunOptions {
  int every = 1;           ///< track the first of every so many images
  int maximum_frames = 0;  ///< stop after so many tracked images; 0: all
};

/// Feeds the tracker with the whole recording, as fast as it goes, and shows every frame to
/// `observe`. Returns the number of frames. Throws std::invalid_argument for options out of range.
int runSequence(ImageSource* source, Tracker* tracker, const RunOptions& options,
                const std::function<void(const TrackedFrame&)>& observe);

}  // namespace active_matching_slam
