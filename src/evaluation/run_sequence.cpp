#include "active_matching_slam/evaluation/run_sequence.h"

#include <stdexcept>
#include <string>

namespace active_matching_slam {

int runSequence(ImageSource* source, Tracker* tracker, const RunOptions& options,
                const std::function<void(const TrackedFrame&)>& observe) {
  if (options.every < 1)
    throw std::invalid_argument("every is " + std::to_string(options.every) +
                                ", must be at least 1");
  if (options.maximum_frames < 0)
    throw std::invalid_argument("max_frames is " + std::to_string(options.maximum_frames) +
                                ", must be at least 0");
  int frames = 0;
  cv::Mat image;
  double stamp_s = 0.0;
  while ((options.maximum_frames == 0 || frames < options.maximum_frames) &&
         source->next(&image, &stamp_s)) {
    observe(*tracker->track(image, stamp_s, source->fault()));
    ++frames;
    for (int skipped = 1; skipped < options.every; ++skipped)
      if (!source->skip()) return frames;
  }
  return frames;
}

}  // namespace active_matching_slam
