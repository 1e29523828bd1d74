#pragma once

#include <cmath>

namespace active_matching_slam {

/// Lengths in the image that grow with its size are stated in pixels of an image of 640 x 480. In
/// one of another size they are so many times as long: as the root of the number of pixels, so that
/// panoramas are no larger than they are.
inline double pixelScale(int width, int height) {
  return std::sqrt(static_cast<double>(width) * height / (640.0 * 480.0));
}

/// Of an image of 4:3.
inline double pixelScale(int width) { return width / 640.0; }

}  // namespace active_matching_slam
