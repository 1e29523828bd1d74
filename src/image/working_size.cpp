#include "active_matching_slam/image/working_size.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/math/pixel_scale.h"

namespace active_matching_slam {
namespace {

/// From how many pixels for one on an image is smoothed first. Derivation: the middle, as a factor,
/// between 1 and 2, where every or every other pixel would be taken.
constexpr double kSmoothedFrom = 1.4142135623730951;

}  // namespace

WorkingSize::WorkingSize(const CameraCalibration& given, int working_width)
    : given_(given), working_(given), size_(given.width, given.height) {
  const double excess = pixelScale(given.width, given.height) / pixelScale(working_width);
  if (!(excess > 1.0)) return;
  const auto reduced = [excess](int length) {
    return std::max(1, static_cast<int>(std::lround(length / excess)));
  };
  size_ = {reduced(given.width), reduced(given.height)};
  working_.width = size_.width;
  working_.height = size_.height;
  // Sizes are whole numbers: both axes have scales of their own.
  working_.fx *= static_cast<double>(size_.width) / given.width;
  working_.fy *= static_cast<double>(size_.height) / given.height;
  const Eigen::Vector2d centre = reduce(Eigen::Vector2d(given.cx, given.cy));
  working_.cx = centre.x();
  working_.cy = centre.y();
}

cv::Mat WorkingSize::reduce(const cv::Mat& image) const {
  cv::Mat reduced = image;
  while (reduced.cols >= 2 * size_.width && reduced.rows >= 2 * size_.height) {
    cv::Mat half;
    cv::resize(reduced, half, {reduced.cols / 2, reduced.rows / 2}, 0.0, 0.0, cv::INTER_AREA);
    reduced = half;
  }
  if (reduced.size() == size_) return reduced;
  // The rest is less than a half: interpolation, ten times as fast as means over parts of pixels,
  // leaves nothing out where what it can't show is smoothed away.
  cv::Mat rest = reduced;
  if (rest.cols > kSmoothedFrom * size_.width) cv::GaussianBlur(reduced, rest, {3, 3}, 0.0);
  cv::resize(rest, reduced, size_, 0.0, 0.0, cv::INTER_LINEAR);
  return reduced;
}

Eigen::Vector2d WorkingSize::reduce(const Eigen::Vector2d& pixel) const {
  return {(pixel.x() + 0.5) * size_.width / given_.width - 0.5,
          (pixel.y() + 0.5) * size_.height / given_.height - 0.5};
}

double WorkingSize::scale() const {
  return std::sqrt(static_cast<double>(size_.area()) / given_.width / given_.height);
}

}  // namespace active_matching_slam
