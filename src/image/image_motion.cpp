#include "active_matching_slam/image/image_motion.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace active_matching_slam {
namespace {

constexpr int kFineWidth = 80;         ///< of the copies [px]
constexpr double kCoarseOfFine = 0.5;  ///< width of the coarse copies, by that of the fine
constexpr double kSmoothing = 2.0;     ///< standard deviation [px of the copies]
constexpr double kLeastCorrelation = 0.75;
constexpr double kSigma = 0.75;  ///< of the result [px of the finest copies]
/// Ratio test between two alignments at different places: 1 - correlation of the better one must be
/// below this fraction of that of the other.
constexpr double kClearlyBetter = 0.5;
constexpr double kSamePlaceSigmas = 4.0;
constexpr int kMostSteps = 30;
constexpr double kSmallGain = 1e-3;  ///< of the correlation: a step that gains less is the last

cv::Mat smallCopy(const cv::Mat& image, double scale) {
  cv::Mat small, copy;
  cv::resize(image, small, cv::Size(), scale, scale, cv::INTER_AREA);
  small.convertTo(copy, CV_32F);
  return copy;
}

cv::Mat smooth(const cv::Mat& image) {
  cv::Mat result;
  cv::GaussianBlur(image, result, cv::Size(), kSmoothing);
  return result;
}

/// Both images at one scale.
struct Copies {
  double scale;
  cv::Mat previous, now;
  cv::Mat used;  ///< CV_8U; empty: all
};

/// `used` at the size of a copy, less what smoothing brought in from beside it.
cv::Mat usedOfCopy(const cv::Mat& used, const cv::Size& size) {
  if (used.empty()) return {};
  constexpr int kReach = static_cast<int>(2.0 * kSmoothing);
  cv::Mat small;
  cv::resize(used, small, size, 0.0, 0.0, cv::INTER_AREA);
  cv::erode(small == 255, small, cv::Mat::ones(2 * kReach + 1, 2 * kReach + 1, CV_8U));
  return small;
}

/// Improves the motion on the copies. Returns the correlation reached, 0 for none.
double align(const Copies& copies, ImageMotion* motion) {
  const double scale = copies.scale;
  // A pixel centre x is at scale x + offset in the copies.
  const Eigen::Vector2d offset = Eigen::Vector2d::Constant(0.5 * (scale - 1.0));
  const Eigen::Vector2d start = scale * motion->shift_px + offset - motion->turn * offset;
  cv::Mat warp = (cv::Mat_<float>(2, 3) << motion->turn(0, 0), motion->turn(0, 1), start.x(),
                  motion->turn(1, 0), motion->turn(1, 1), start.y());
  double correlation = 0.0;
  try {
    correlation = cv::findTransformECC(
        copies.previous, copies.now, warp, cv::MOTION_EUCLIDEAN,
        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kMostSteps, kSmallGain),
        copies.used.empty() ? cv::InputArray(cv::noArray()) : cv::InputArray(copies.used), 1);
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

/// Largest distance [px] between where two motions take a corner of the image.
double farthestApart(const ImageMotion& a, const ImageMotion& b, const cv::Size& size) {
  double farthest = 0.0;
  for (const double u : {0.0, static_cast<double>(size.width)})
    for (const double v : {0.0, static_cast<double>(size.height)})
      farthest = std::max(farthest, (a({u, v}) - b({u, v})).norm());
  return farthest;
}

}  // namespace

std::optional<ImageMotion> estimateImageMotion(const cv::Mat& previous, const cv::Mat& image,
                                               const ImageMotion& guess, const cv::Mat& used) {
  if (image.empty() || image.size() != previous.size() || image.type() != CV_8UC1 ||
      previous.type() != CV_8UC1)
    return std::nullopt;
  const double scale = static_cast<double>(kFineWidth) / image.cols, sigma_px = kSigma / scale;
  const cv::Mat small_previous = smallCopy(previous, scale), small_now = smallCopy(image, scale);
  const Copies fine = {scale, smooth(small_previous), smooth(small_now),
                       usedOfCopy(used, small_now.size())};
  const cv::Mat coarse_now = smooth(smallCopy(small_now, kCoarseOfFine));
  const Copies coarse = {kCoarseOfFine * scale, smooth(smallCopy(small_previous, kCoarseOfFine)),
                         coarse_now, usedOfCopy(used, coarse_now.size())};
  // Coarse to fine reaches far; from the guess the fine copies alone find what is near. Where the
  // scene repeats itself these are two places, and one is right only if it fits clearly better.
  ImageMotion far = guess, near = guess;
  const double of_near = align(fine, &near);
  double of_far = align(coarse, &far);
  const auto areOnePlace = [&] {
    return farthestApart(near, far, image.size()) <= kSamePlaceSigmas * sigma_px;
  };
  if (of_far > 0.0 && of_near >= kLeastCorrelation && areOnePlace()) {
    of_far = of_near;
    far = near;
  } else if (of_far > 0.0) {
    of_far = align(fine, &far);
  }
  const bool is_near = of_near > of_far;
  if (std::max(of_near, of_far) < kLeastCorrelation) return std::nullopt;
  const double misfit = 1.0 - std::max(of_near, of_far), other = 1.0 - std::min(of_near, of_far);
  if (misfit > kClearlyBetter * other && !areOnePlace()) return std::nullopt;
  ImageMotion motion = is_near ? near : far;
  motion.sigma_px = sigma_px;
  return motion;
}

}  // namespace active_matching_slam
