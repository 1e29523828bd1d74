#include "orb_corners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kPatchSize = 31, kRadius = kPatchSize / 2;
constexpr int kCornersOfScale = 1000;
constexpr double kScales[] = {1.6, 1.26, 1.0, 0.8, 0.63, 0.5};  // the longest work first

/// Direction from a point to the centroid of intensity of the disc around it, as ORB defines it.
/// Points of the disc outside the image are left out together with their opposites.
float orientation(const cv::Mat& image, const cv::Point& center) {
  const int reach_x = std::min({kRadius, center.x, image.cols - 1 - center.x});
  const int reach_y = std::min({kRadius, center.y, image.rows - 1 - center.y});
  int sum_x = 0, sum_y = 0;
  for (int y = -reach_y; y <= reach_y; ++y) {
    const auto half = static_cast<int>(std::sqrt(double(kRadius * kRadius - y * y)));
    const int reach = std::min(reach_x, half);
    const std::uint8_t* row = image.ptr<std::uint8_t>(center.y + y) + center.x;
    int sum = 0;
    for (int x = -reach; x <= reach; ++x) {
      sum += row[x];
      sum_x += x * row[x];
    }
    sum_y += y * sum;
  }
  return cv::fastAtan2(static_cast<float>(sum_y), static_cast<float>(sum_x));
}

/// One scale; keypoints near the border are kept, what lies beyond it is mirrored.
cv::Ptr<cv::ORB> createDescriber() {
  return cv::ORB::create(kCornersOfScale, 1.2f, 1, 1, 0, 2, cv::ORB::HARRIS_SCORE, kPatchSize);
}

cv::KeyPoint keypointAt(const cv::Mat& image, const cv::Point& point) {
  return {cv::Point2f(point), static_cast<float>(kPatchSize), orientation(image, point), 0.0f, 0};
}

DescribedPoints describeCornersAtScale(const cv::Mat& image, double scale) {
  DescribedPoints result;
  cv::Mat scaled;
  cv::resize(image, scaled, cv::Size(), scale, scale,
             scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (scaled.cols < 2 * kPatchSize || scaled.rows < 2 * kPatchSize) return result;
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(scaled, corners, kCornersOfScale, 0.005, 4.0);
  std::vector<cv::KeyPoint> keypoints;
  for (const cv::Point2f& corner : corners) {
    const cv::Point point(cvRound(corner.x), cvRound(corner.y));
    if (point.x >= kRadius && point.y >= kRadius && point.x < scaled.cols - kRadius &&
        point.y < scaled.rows - kRadius)
      keypoints.push_back(keypointAt(scaled, point));
  }
  if (!keypoints.empty()) createDescriber()->compute(scaled, keypoints, result.descriptors);
  const double factor_u = static_cast<double>(image.cols) / scaled.cols;
  const double factor_v = static_cast<double>(image.rows) / scaled.rows;
  for (const cv::KeyPoint& keypoint : keypoints)
    result.pixels.emplace_back((keypoint.pt.x + 0.5) * factor_u - 0.5,
                               (keypoint.pt.y + 0.5) * factor_v - 0.5);
  return result;
}

}  // namespace

DescribedPoints describeCorners(const cv::Mat& image, const ImageMask& mask) {
  std::array<DescribedPoints, std::size(kScales)> of_scale;
  const auto describe = [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
      of_scale[i] = describeCornersAtScale(image, kScales[i]);
  };
  const auto count = static_cast<int>(of_scale.size());
  cv::parallel_for_(cv::Range(0, count), describe, count);
  DescribedPoints result;
  for (const DescribedPoints& points : of_scale) {
    for (std::size_t i = 0; i < points.pixels.size(); ++i) {
      if (!mask.isSearched(points.pixels[i])) continue;
      result.pixels.push_back(points.pixels[i]);
      result.descriptors.push_back(points.descriptors.row(static_cast<int>(i)));
    }
  }
  return result;
}

cv::Mat describePoint(const cv::Mat& image, const Eigen::Vector2d& point) {
  std::vector<cv::KeyPoint> keypoints{
      keypointAt(image, cv::Point(cvRound(point.x()), cvRound(point.y())))};
  cv::Mat descriptor;
  createDescriber()->compute(image, keypoints, descriptor);
  return keypoints.size() == 1 ? descriptor : cv::Mat();
}

}  // namespace active_matching_slam
