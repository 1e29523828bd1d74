#include "orb_corners.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kPatchSize = 31, kRadius = kPatchSize / 2;
constexpr int kCornersOfScale = 1000;
constexpr double kScales[] = {1.6, 1.26, 1.0, 0.8, 0.63, 0.5};
/// Cost: pixels of a band, by the time of a step; with smaller ones more rows are read twice.
constexpr int kBandPixels = 200000;
/// Rows that a band reads on either side. Derivation: a rotated patch reaches half its diagonal,
/// and smoothing 3 pixels more.
constexpr int kBandMargin = 26;

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

}  // namespace

CornerScan::CornerScan(const cv::Mat& image, const ImageMask& mask) : image_(image), mask_(mask) {
  beginScale();
}

bool CornerScan::isDone() const { return scale_ == std::size(kScales); }

/// Scales at which the image is too small have no bands.
void CornerScan::beginScale() {
  for (band_ = bands_ = 0; scale_ < std::size(kScales); ++scale_) {
    const double scale = kScales[scale_];
    cv::resize(image_, scaled_, cv::Size(), scale, scale,
               scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
    if (scaled_.cols < 2 * kPatchSize || scaled_.rows < 2 * kPatchSize) continue;
    bands_ = static_cast<int>(scaled_.total()) / kBandPixels + 1;
    return;
  }
}

cv::Range CornerScan::band() const {
  return {band_ * scaled_.rows / bands_, (band_ + 1) * scaled_.rows / bands_};
}

double CornerScan::nextPixels() const {
  return isDone() ? 0.0 : static_cast<double>(band().size()) * scaled_.cols;
}

void CornerScan::step() {
  if (isDone()) return;
  const cv::Range rows = band();
  const auto widened = [&](int margin) {
    return cv::Range(std::max(rows.start - margin, 0), std::min(rows.end + margin, scaled_.rows));
  };
  std::vector<cv::Point2f> corners;
  constexpr int kGradientMargin = 3;  // Derivation: of a gradient, summed over 3 x 3, and a maximum
  const cv::Range searched = widened(kGradientMargin), read = widened(kBandMargin);
  cv::goodFeaturesToTrack(scaled_.rowRange(searched), corners, kCornersOfScale / bands_, 0.005,
                          4.0);
  std::vector<cv::KeyPoint> keypoints;
  for (const cv::Point2f& corner : corners) {
    const cv::Point point(cvRound(corner.x), cvRound(corner.y) + searched.start);
    if (point.y < rows.start || point.y >= rows.end || point.x < kRadius || point.y < kRadius ||
        point.x >= scaled_.cols - kRadius || point.y >= scaled_.rows - kRadius)
      continue;
    keypoints.push_back(keypointAt(scaled_, point));
    keypoints.back().pt.y -= static_cast<float>(read.start);
  }
  cv::Mat descriptors;
  if (!keypoints.empty())
    createDescriber()->compute(scaled_.rowRange(read), keypoints, descriptors);
  const double factor_u = static_cast<double>(image_.cols) / scaled_.cols;
  const double factor_v = static_cast<double>(image_.rows) / scaled_.rows;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const cv::Point2f& point = keypoints[i].pt;
    const Eigen::Vector2d pixel((point.x + 0.5) * factor_u - 0.5,
                                (point.y + read.start + 0.5) * factor_v - 0.5);
    if (!mask_.isSearched(pixel)) continue;
    points_.pixels.push_back(pixel);
    points_.descriptors.push_back(descriptors.row(static_cast<int>(i)));
  }
  if (++band_ < bands_) return;
  ++scale_;
  beginScale();
}

cv::Mat describePoint(const cv::Mat& image, const Eigen::Vector2d& point) {
  std::vector<cv::KeyPoint> keypoints{
      keypointAt(image, cv::Point(cvRound(point.x()), cvRound(point.y())))};
  cv::Mat descriptor;
  createDescriber()->compute(image, keypoints, descriptor);
  return keypoints.size() == 1 ? descriptor : cv::Mat();
}

}  // namespace active_matching_slam
