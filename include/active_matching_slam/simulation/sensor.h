#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace active_matching_slam {

/// Turns light into the 8-bit grey image of a camera with linear response: vignetting, gain, noise
/// (constant and growing with light), clipping.
class Sensor {
 public:
  /// `noise`: standard deviation at mid-grey (128) [grey levels], 0 to 50. `vignetting`: loss of
  /// light in the corners, 0 to 0.9. Throws std::invalid_argument with name, value and range.
  Sensor(int width, int height, double noise, double vignetting);

  /// Standard deviation of the noise at a grey level: a third of the variance at mid-grey does not
  /// depend on light, the rest grows with it.
  double noiseAt(double grey) const;

  /// `radiance`: CV_32FC1. `seed`: one per frame. Reuses `image` (CV_8UC1).
  void expose(const cv::Mat& radiance, double gain, std::uint64_t seed, cv::Mat& image) const;

 private:
  double noise_;
  cv::Mat transmission_;
  std::vector<float> normal_;  ///< quantiles of the normal distribution
};

}  // namespace active_matching_slam
