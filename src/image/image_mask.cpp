#include "active_matching_slam/image/image_mask.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace active_matching_slam {
namespace {

constexpr double kMidGrey = 127.5;  ///< Derivation: halfway from black to white
/// What matching reads beyond a template's own pixels. Derivation: one pixel, as far as the fit
/// moves from the best one; one for differences; four, of the eight of which a value in between is
/// made.
constexpr int kTemplateRim = 6;

/// Pixels around which a square of `reach` to each side is used. Beyond the image all is.
cv::Mat centresOf(const cv::Mat& used, int reach) {
  cv::Mat centres;
  cv::erode(used, centres, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  return centres;
}

}  // namespace

ImageMask::ImageMask(const cv::Mat& used, const ImageOptions& options) {
  if (used.empty()) throw std::invalid_argument("the mask is empty");
  if (used.type() != CV_8UC1) throw std::invalid_argument("the mask is not 8-bit grey");
  used_ = used > kMidGrey;
  if (cv::countNonZero(used_) == 0)
    throw std::invalid_argument("the mask has no white pixel: nothing would be used");
  template_centres_ = centresOf(used_, options.template_size_px / 2 + kTemplateRim);
  patch_centres_ = centresOf(used_, std::max(options.template_size_px / 2 + kTemplateRim,
                                             options.source_patch_size_px / 2));
}

bool ImageMask::isSearched(const Eigen::Vector2d& pixel) const {
  if (isWhole()) return true;
  const int u = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, used_.cols - 1);
  const int v = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, used_.rows - 1);
  return template_centres_.at<std::uint8_t>(v, u) != 0;
}

cv::Mat ImageMask::applyTo(const cv::Mat& image) const {
  if (isWhole()) return image;
  cv::Mat result(image.size(), image.type(), cv::Scalar::all(std::floor(kMidGrey)));
  image.copyTo(result, used_);
  return result;
}

cv::Mat readMask(const std::string& path) {
  const cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (mask.empty()) throw std::runtime_error(path + ": not a picture that can be read");
  return mask;
}

}  // namespace active_matching_slam
