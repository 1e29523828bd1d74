#include "active_matching_slam/image/template.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {

double Template::contrast() const {
  return size > 0 ? std::sqrt(static_cast<double>(energy)) / (size * size) : 0.0;
}

cv::Mat Template::image() const {
  cv::Mat copy(size, size, CV_8UC1);
  for (int row = 0; row < size; ++row)
    std::copy_n(&pixels[row * size], size, copy.ptr<std::uint8_t>(row));
  return copy;
}

void updateSums(Template* patch) {
  const int n = patch->size * patch->size;
  std::int64_t sum = 0, squares = 0;
  for (int i = 0; i < n; ++i) {
    sum += patch->pixels[i];
    squares += static_cast<int>(patch->pixels[i]) * patch->pixels[i];
  }
  patch->sum = sum;
  patch->energy = n * squares - sum * sum;
}

std::optional<Template> makeTemplate(const cv::Mat& image) {
  if (image.type() != CV_8UC1 || image.rows != image.cols || image.rows % 2 == 0 ||
      image.rows > Template::kMaximumSize)
    return std::nullopt;
  Template patch;
  patch.size = image.rows;
  for (int row = 0; row < patch.size; ++row)
    std::copy_n(image.ptr<std::uint8_t>(row), patch.size, &patch.pixels[row * patch.size]);
  updateSums(&patch);
  return patch;
}

}  // namespace active_matching_slam
