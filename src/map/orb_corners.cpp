#include "orb_corners.h"

#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kPatchSize = 31, kRadius = kPatchSize / 2;
constexpr int kCornersOfScale = 1000;
constexpr double kScales[] = {1.6, 1.26, 1.0, 0.8, 0.63, 0.5};

/// Direction from a point to the centroid of intensity of the disc around it, as ORB defines it.
/// Points of the disc outside the image are left out together with their opposites.
float orientation(const cv::Mat& image, const cv::Point& center) {
  double sum_x = 0.0, sum_y = 0.0;
  for (int y = -kRadius; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      if (x * x + y * y > kRadius * kRadius) continue;
      const cv::Point point = center + cv::Point(x, y), opposite = center - cv::Point(x, y);
      const cv::Rect area(0, 0, image.cols, image.rows);
      if (!area.contains(point) || !area.contains(opposite)) continue;
      const int value = image.at<std::uint8_t>(point);
      sum_x += x * value;
      sum_y += y * value;
    }
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

}  // namespace

DescribedPoints describeCorners(const cv::Mat& image) {
  DescribedPoints result;
  const auto orb = createDescriber();
  for (const double scale : kScales) {
    cv::Mat scaled;
    cv::resize(image, scaled, cv::Size(), scale, scale,
               scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
    if (scaled.cols < 2 * kPatchSize || scaled.rows < 2 * kPatchSize) continue;
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(scaled, corners, kCornersOfScale, 0.005, 4.0);
    std::vector<cv::KeyPoint> keypoints;
    for (const cv::Point2f& corner : corners) {
      const cv::Point point(cvRound(corner.x), cvRound(corner.y));
      if (point.x >= kRadius && point.y >= kRadius && point.x < scaled.cols - kRadius &&
          point.y < scaled.rows - kRadius)
        keypoints.push_back(keypointAt(scaled, point));
    }
    cv::Mat descriptors;
    if (!keypoints.empty()) orb->compute(scaled, keypoints, descriptors);
    const double factor_u = static_cast<double>(image.cols) / scaled.cols;
    const double factor_v = static_cast<double>(image.rows) / scaled.rows;
    for (const cv::KeyPoint& keypoint : keypoints)
      result.pixels.emplace_back((keypoint.pt.x + 0.5) * factor_u - 0.5,
                                 (keypoint.pt.y + 0.5) * factor_v - 0.5);
    result.descriptors.push_back(descriptors);
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
