#include "active_matching_slam/image/image_quality.h"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>

namespace active_matching_slam {

ImageQuality measureImageQuality(const cv::Mat& image) {
  ImageQuality quality;
  if (image.empty() || image.type() != CV_8UC1) return quality;
  std::int64_t count = 0, sum = 0, squares = 0, differences = 0, pairs = 0;
  for (int v = 0; v < image.rows; v += 4) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(v);
    // 32 bits hold a row of up to 66000 pixels, and let the compiler vectorise.
    std::uint32_t row_sum = 0, row_squares = 0, row_differences = 0;
    for (int u = 0; u < image.cols; ++u) {
      row_sum += row[u];
      row_squares += static_cast<std::uint32_t>(row[u]) * row[u];
    }
    for (int u = 1; u < image.cols; ++u) row_differences += std::abs(row[u] - row[u - 1]);
    count += image.cols;
    pairs += image.cols - 1;
    sum += row_sum;
    squares += row_squares;
    differences += row_differences;
  }
  const double n = static_cast<double>(count);
  quality.mean = sum / n;
  quality.contrast = std::sqrt(static_cast<double>(count * squares - sum * sum)) / n;
  quality.sharpness = pairs > 0 ? static_cast<double>(differences) / pairs : 0.0;
  return quality;
}

double meanAbsoluteDifference(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != CV_8UC1 || b.type() != CV_8UC1)
    return std::numeric_limits<double>::infinity();
  return a.empty() ? 0.0 : cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

bool isRepeatedImage(const cv::Mat& image, const cv::Mat& previous) {
  if (image.empty() || image.size() != previous.size() || image.type() != previous.type())
    return false;
  const std::size_t bytes = image.cols * image.elemSize();
  for (int v = 0; v < image.rows; ++v)
    if (std::memcmp(image.ptr(v), previous.ptr(v), bytes) != 0) return false;
  return true;
}

}  // namespace active_matching_slam
