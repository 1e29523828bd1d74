#include "active_matching_slam/image/patch.h"

#include <cmath>

namespace active_matching_slam {

std::optional<SourcePatch> extractSourcePatch(const cv::Mat& image, const Eigen::Vector2d& pixel,
                                              const Eigen::Isometry3d& T_world_camera,
                                              int size_px) {
  const int half = size_px / 2;
  // Written so that NaN fails, and before any conversion to int.
  if (image.type() != CV_8UC1 || size_px < 1 || size_px % 2 == 0 ||
      !(pixel.x() >= half && pixel.y() >= half && pixel.x() <= image.cols - 1 - half &&
        pixel.y() <= image.rows - 1 - half))
    return std::nullopt;
  const int left = static_cast<int>(std::lround(pixel.x())) - half;
  const int top = static_cast<int>(std::lround(pixel.y())) - half;
  SourcePatch patch;
  patch.image = image(cv::Rect(left, top, size_px, size_px)).clone();
  patch.pixel = pixel;
  patch.center = pixel - Eigen::Vector2d(left, top);
  patch.T_world_camera = T_world_camera;
  return patch;
}

}  // namespace active_matching_slam
