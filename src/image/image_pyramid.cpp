#include "active_matching_slam/image/image_pyramid.h"

#include <opencv2/imgproc.hpp>

namespace active_matching_slam {

void ImagePyramid::begin(const cv::Mat& image) {
  levels_.assign(1, image);
  bordered_.clear();
}

const cv::Mat& ImagePyramid::bordered(int level) {
  const auto wanted = static_cast<std::size_t>(level);
  while (levels_.size() <= wanted) {
    cv::Mat half;
    cv::pyrDown(levels_.back(), half);
    levels_.push_back(half);
  }
  if (bordered_.size() <= wanted) bordered_.resize(wanted + 1);
  if (bordered_[wanted].empty())
    cv::copyMakeBorder(levels_[wanted], bordered_[wanted], kBorder, kBorder, kBorder, kBorder,
                       cv::BORDER_REPLICATE);
  return bordered_[wanted];
}

}  // namespace active_matching_slam
