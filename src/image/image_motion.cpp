#include "active_matching_slam/image/image_motion.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace active_matching_slam {
namespace {

constexpr int kWidths[] = {40, 80};  ///< of the copies, coarse to fine [px]
constexpr double kSmoothing = 2.0;   ///< standard deviation [px of the copies]
constexpr double kLeastCorrelation = 0.75;
constexpr double kSigma = 0.75;  ///< of the result [px of the finest copies]
constexpr int kMostSteps = 30;
constexpr double kSmallGain = 1e-3;  ///< of the correlation: a step that gains less is the last

cv::Mat smallCopy(const cv::Mat& image, double scale) {
  cv::Mat small, smooth;
  cv::resize(image, small, cv::Size(), scale, scale, cv::INTER_AREA);
  small.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, cv::Size(), kSmoothing);
  return smooth;
}

/// Improves the motion on copies of that scale. Returns the correlation reached, 0 for none.
double align(const cv::Mat& previous, const cv::Mat& image, double scale, ImageMotion* motion) {
  // A pixel centre x is at scale x + offset in the copies.
  const Eigen::Vector2d offset = Eigen::Vector2d::Constant(0.5 * (scale - 1.0));
  const Eigen::Vector2d start = scale * motion->shift_px + offset - motion->turn * offset;
  cv::Mat warp = (cv::Mat_<float>(2, 3) << motion->turn(0, 0), motion->turn(0, 1), start.x(),
                  motion->turn(1, 0), motion->turn(1, 1), start.y());
  double correlation = 0.0;
  try {
    correlation = cv::findTransformECC(
        smallCopy(previous, scale), smallCopy(image, scale), warp, cv::MOTION_EUCLIDEAN,
        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kMostSteps, kSmallGain),
        cv::noArray(), 1);
  } catch (const cv::Exception&) {  // OpenCV's way of saying that it did not converge
    return 0.0;
  }
  if (!(correlation > 0.0)) return 0.0;
  motion->turn << warp.at<float>(0, 0), warp.at<float>(0, 1), warp.at<float>(1, 0),
      warp.at<float>(1, 1);
  const Eigen::Vector2d shift(warp.at<float>(0, 2), warp.at<float>(1, 2));
  motion->shift_px = (shift - offset + motion->turn * offset) / scale;
  return correlation;
}

}  // namespace

std::optional<ImageMotion> estimateImageMotion(const cv::Mat& previous, const cv::Mat& image,
                                               const ImageMotion& guess) {
  if (image.empty() || image.size() != previous.size() || image.type() != CV_8UC1 ||
      previous.type() != CV_8UC1)
    return std::nullopt;
  ImageMotion motion = guess;
  double correlation = 0.0, scale = 1.0;
  for (const int width : kWidths) {
    scale = static_cast<double>(width) / image.cols;
    correlation = align(previous, image, scale, &motion);
  }
  if (correlation < kLeastCorrelation) return std::nullopt;
  motion.sigma_px = kSigma / scale;
  return motion;
}

}  // namespace active_matching_slam
