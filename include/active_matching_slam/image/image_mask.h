#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>

#include "active_matching_slam/image/image_options.h"

namespace active_matching_slam {

/// Which pixels of an image show the scene. What others show (a gripper, the robot itself) plays no
/// part in anything: these pixels are read by nothing.
class ImageMask {
 public:
  /// All of every image is used.
  ImageMask() = default;

  /// `used`: 8-bit grey; what is nearer to white than to black is used. Throws
  /// std::invalid_argument for an empty picture, one of another type, or one without a white pixel.
  ImageMask(const cv::Mat& used, const ImageOptions& options);

  bool isWhole() const { return used_.empty(); }
  /// These are CV_8U, 255: yes, 0: no, and empty when all of the image is used.
  const cv::Mat& used() const { return used_; }
  /// Pixels around which all that matching a template reads is used.
  const cv::Mat& templateCentres() const { return template_centres_; }
  /// The same of the source patch of a new feature.
  const cv::Mat& patchCentres() const { return patch_centres_; }

  /// Whether a template can be matched at `pixel`, which lies in the image.
  bool isSearched(const Eigen::Vector2d& pixel) const;

  /// The image with what is not used in plain grey; the image itself when all is used.
  cv::Mat applyTo(const cv::Mat& image) const;

 private:
  cv::Mat used_, template_centres_, patch_centres_;
};

/// A mask from a picture file. Throws std::runtime_error naming the file that can't be read.
cv::Mat readMask(const std::string& path);

}  // namespace active_matching_slam
