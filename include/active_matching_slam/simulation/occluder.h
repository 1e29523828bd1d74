#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace active_matching_slam {

/// A hand that crosses the view again and again, close to the camera.
class Occluder {
 public:
  explicit Occluder(std::uint64_t seed) : seed_(seed) {}

  /// Covers part of the light on the sensor (CV_32FC1) at time t_s; `exposure_s` softens its edge.
  /// Returns true when the hand is in view.
  bool cover(double t_s, double exposure_s, cv::Mat& radiance) const;

 private:
  std::uint64_t seed_;
};

}  // namespace active_matching_slam
