#include "active_matching_slam/image/feature_flow.h"

#include <algorithm>
#include <cmath>
#include <opencv2/video/tracking.hpp>

#include "active_matching_slam/math/pixel_scale.h"

namespace active_matching_slam {
namespace {

constexpr int kWindow_px = 21;  ///< Standard: OpenCV's
/// Width of the coarsest image of the pyramid [px]. Cost: about the least in which a window is
/// still a part of the scene.
constexpr double kCoarsestWidth_px = 80.0;
/// Largest forward-backward error [px of an image 640 wide]. Derivation: a path that went wrong
/// comes back to some other corner, tens of pixels away; one that is right, within one pixel.
constexpr double kForwardBackward_px = 1.0;

}  // namespace

double flowSigma_px(int image_width) { return kForwardBackward_px * pixelScale(image_width); }

std::vector<std::optional<Eigen::Vector2d>> trackPoints(
    const cv::Mat& previous, const cv::Mat& image,
    const std::vector<std::optional<Eigen::Vector2d>>& previous_px) {
  std::vector<std::optional<Eigen::Vector2d>> tracked(previous_px.size());
  std::vector<std::size_t> given;
  std::vector<cv::Point2f> from;
  for (std::size_t i = 0; i < previous_px.size(); ++i) {
    if (!previous_px[i] || !previous_px[i]->allFinite()) continue;
    given.push_back(i);
    from.emplace_back(static_cast<float>(previous_px[i]->x()),
                      static_cast<float>(previous_px[i]->y()));
  }
  if (given.empty()) return tracked;
  const cv::Size window(kWindow_px, kWindow_px);
  const int levels =
      std::max(0, static_cast<int>(std::lround(std::log2(previous.cols / kCoarsestWidth_px))));
  std::vector<cv::Mat> before, now;
  cv::buildOpticalFlowPyramid(previous, before, window, levels);
  cv::buildOpticalFlowPyramid(image, now, window, levels);
  std::vector<cv::Point2f> to, back;
  std::vector<uchar> is_found, is_back;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(before, now, from, to, is_found, error, window, levels);
  cv::calcOpticalFlowPyrLK(now, before, to, back, is_back, error, window, levels);
  const double limit_px = flowSigma_px(image.cols);
  for (std::size_t k = 0; k < given.size(); ++k)
    if (is_found[k] && is_back[k] && cv::norm(back[k] - from[k]) <= limit_px)
      tracked[given[k]] = Eigen::Vector2d(to[k].x, to[k].y);
  return tracked;
}

}  // namespace active_matching_slam
