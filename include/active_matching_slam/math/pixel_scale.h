#pragma once

namespace active_matching_slam {

/// Lengths in the image that grow with its size are stated in pixels of an image 640 wide. In one
/// of `width` pixels they are so many times as long.
inline double pixelScale(int width) { return width / 640.0; }

}  // namespace active_matching_slam
