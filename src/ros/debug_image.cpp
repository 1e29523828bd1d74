#include "active_matching_slam/ros/debug_image.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <unordered_map>

#include "active_matching_slam/information/submap_color.h"
#include "active_matching_slam/ros/submap_view.h"

namespace active_matching_slam {
namespace {

const cv::Scalar kGreen(90, 230, 60), kOrange(20, 150, 255), kRed(60, 60, 255), kBlue(255, 160, 80),
    kGold(40, 200, 255), kWhite(255, 255, 255), kGrey(150, 150, 150);
constexpr int kLeastWidth_px = 640;
constexpr int kShift = 4;  // drawing coordinates in sixteenths of a pixel

/// Draws in coordinates of the original image.
class Canvas {
 public:
  explicit Canvas(const cv::Mat& gray)
      : scale_(std::clamp((kLeastWidth_px + gray.cols - 1) / gray.cols, 1, 4)) {
    cv::Mat large;
    cv::resize(gray, large, cv::Size(), scale_, scale_, cv::INTER_LINEAR);
    cv::cvtColor(large, image_, cv::COLOR_GRAY2BGR);
  }

  void ellipse(const Eigen::Vector2d& center, const Eigen::Matrix2d& covariance,
               const cv::Scalar& color) {
    const EllipseAxes axes = threeSigmaEllipse(covariance);
    const double limit = 4.0 * image_.cols;
    if (!isDrawable(center) || !(axes.major_px * scale_ < limit)) return;
    const cv::Size size(toFixed(axes.major_px * scale_), toFixed(axes.minor_px * scale_));
    cv::ellipse(image_, at(center), size, axes.angle_deg, 0, 360, color, 1, cv::LINE_AA, kShift);
  }
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& color,
            int width = 1) {
    if (isDrawable(from) && isDrawable(to))
      cv::line(image_, at(from), at(to), color, width, cv::LINE_AA, kShift);
  }
  void dot(const Eigen::Vector2d& center, double radius_px, const cv::Scalar& color) {
    if (isDrawable(center))
      cv::circle(image_, at(center), toFixed(radius_px), color, cv::FILLED, cv::LINE_AA, kShift);
  }
  void cross(const Eigen::Vector2d& center, double radius_px, const cv::Scalar& color) {
    const double r = radius_px / scale_;
    line(center + Eigen::Vector2d(-r, -r), center + Eigen::Vector2d(r, r), color);
    line(center + Eigen::Vector2d(-r, r), center + Eigen::Vector2d(r, -r), color);
  }
  void label(const Eigen::Vector2d& position, const std::string& text, const cv::Scalar& color) {
    if (!isDrawable(position)) return;
    cv::Point corner = at(position);
    corner = cv::Point(corner.x >> kShift, corner.y >> kShift) + cv::Point(4, -4);
    cv::putText(image_, text, corner, cv::FONT_HERSHEY_SIMPLEX, 0.35, color, 1, cv::LINE_AA);
  }

  cv::Mat& image() { return image_; }

 private:
  static int toFixed(double value) { return cvRound(value * (1 << kShift)); }
  cv::Point at(const Eigen::Vector2d& pixel) const {
    return {toFixed((pixel.x() + 0.5) * scale_ - 0.5), toFixed((pixel.y() + 0.5) * scale_ - 0.5)};
  }
  bool isDrawable(const Eigen::Vector2d& pixel) const {
    return pixel.allFinite() && pixel.cwiseAbs().maxCoeff() < 1e4;
  }

  int scale_;
  cv::Mat image_;
};

cv::Scalar statusColor(const TrackedFeature& feature) {
  switch (feature.status) {
    case FeatureStatus::kMatched:
      return kGreen;
    case FeatureStatus::kRejected:
      return kOrange;
    case FeatureStatus::kMissed:
      return kRed;
    default:
      return kBlue;
  }
}

/// From first (0) to last (1): even steps in brightness, readable without colour vision.
cv::Scalar orderColor(double share) {
  static const cv::Mat palette = [] {
    cv::Mat values(1, 256, CV_8UC1), colors;
    for (int value = 0; value < 256; ++value) values.at<uchar>(value) = uchar(value);
    cv::applyColorMap(values, colors, cv::COLORMAP_VIRIDIS);
    return colors;
  }();
  const auto& bgr = palette.at<cv::Vec3b>(cvRound(40 + 215 * std::clamp(share, 0.0, 1.0)));
  return {double(bgr[0]), double(bgr[1]), double(bgr[2])};
}

/// A link of the map's graph whose features are both predicted to be in the image; indices of
/// frame.features.
struct VisibleLink {
  int first, second;
  double information_bits;
  bool in_tree;
};

/// The weakest first, so that the strong ones are drawn over them.
std::vector<VisibleLink> visibleLinks(const TrackedFrame& frame) {
  std::vector<VisibleLink> links;
  if (!frame.graph) return links;
  std::unordered_map<std::int64_t, int> visible;
  for (std::size_t i = 0; i < frame.features.size(); ++i)
    if (frame.features[i].status != FeatureStatus::kNotVisible)
      visible[frame.features[i].id] = static_cast<int>(i);
  for (const InformationLink& link : frame.graph->links) {
    const auto first = visible.find(link.first), second = visible.find(link.second);
    if (first != visible.end() && second != visible.end())
      links.push_back({first->second, second->second, link.information_bits, link.in_tree});
  }
  std::stable_sort(links.begin(), links.end(), [](const VisibleLink& a, const VisibleLink& b) {
    return a.information_bits < b.information_bits;
  });
  return links;
}

void drawLink(const TrackedFrame& frame, const VisibleLink& link, const cv::Scalar& color,
              int width, Canvas* canvas) {
  canvas->line(frame.features[link.first].predicted_px, frame.features[link.second].predicted_px,
               color, width);
}

/// From violet (none) to yellow (the strongest in view).
void drawLinks(const TrackedFrame& frame, double minimum_bits, Canvas* canvas) {
  const std::vector<VisibleLink> links = visibleLinks(frame);
  for (const VisibleLink& link : links)
    if (link.information_bits >= minimum_bits)
      drawLink(frame, link, orderColor(link.information_bits / links.back().information_bits), 1,
               canvas);
}

/// The matcher's own tree where it has one, else the map's.
void drawTree(const TrackedFrame& frame, Canvas* canvas) {
  const int count = frame.prior.size();
  for (const auto& [i, j] : frame.matching.tree_edges)
    if (i >= 0 && j >= 0 && i < count && j < count)
      canvas->line(frame.prior.mean(i), frame.prior.mean(j), kGold);
  if (!frame.matching.tree_edges.empty()) return;
  for (const VisibleLink& link : visibleLinks(frame))
    if (link.in_tree) drawLink(frame, link, kGold, 1, canvas);
}

cv::Scalar submapScalar(int submap) {
  const Eigen::Vector3f rgb = 255.0f * submapRgb(submap);
  return {rgb[2], rgb[1], rgb[0]};
}

/// The map's tree inside each submap, and each feature, in the submap's colour; what joins two
/// submaps in grey.
void drawSubmaps(const TrackedFrame& frame, int level, Canvas* canvas) {
  const std::vector<int> submaps = submapsAtLevel(frame, level);
  for (const VisibleLink& link : visibleLinks(frame)) {
    if (!link.in_tree) continue;
    const bool inside = submaps[link.first] == submaps[link.second];
    drawLink(frame, link, inside ? submapScalar(submaps[link.first]) : kGrey, inside ? 2 : 1,
             canvas);
  }
  for (std::size_t i = 0; i < frame.features.size(); ++i)
    if (frame.features[i].status != FeatureStatus::kNotVisible && submaps[i] >= 0)
      canvas->dot(frame.features[i].predicted_px, 5.0, submapScalar(submaps[i]));
}

void drawSearches(const TrackedFrame& frame, Canvas* canvas) {
  const std::size_t count = frame.matching.trace.size();
  for (std::size_t i = 0; i < count; ++i) {
    const SearchEllipse& ellipse = frame.matching.trace[i].ellipse;
    canvas->ellipse(ellipse.center, ellipse.covariance,
                    orderColor(count > 1 ? double(i) / (count - 1) : 0.0));
  }
}

/// Of a feature's matches the best few: where much of the image is searched there are thousands.
void drawMatches(const TrackedFrame& frame, Canvas* canvas) {
  constexpr std::size_t kMost = 6;
  for (std::vector<SearchMatch> matches : frame.matches) {
    const auto end = matches.begin() + std::min(kMost, matches.size());
    std::partial_sort(matches.begin(), end, matches.end(),
                      [](const SearchMatch& a, const SearchMatch& b) { return a.score > b.score; });
    for (auto match = matches.begin(); match != end; ++match)
      canvas->cross(match->pixel, 2.5, kOrange);
  }
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status == FeatureStatus::kMatched) {
      canvas->line(feature.predicted_px, feature.matched_px, kGreen);
      canvas->dot(feature.matched_px, 2.5, feature.known ? kWhite : kGreen);
    } else if (feature.status == FeatureStatus::kMissed) {
      canvas->cross(feature.predicted_px, 4.0, kRed);
    }
  }
}

void drawTemplates(const TrackedFrame& frame, cv::Mat* image) {
  constexpr int kSide = 32, kGap = 2;
  int x = kGap;
  const int y = image->rows - kSide - kGap;
  if (y < 0) return;
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status == FeatureStatus::kNotVisible || feature.template_image.empty()) continue;
    if (feature.template_image.type() != CV_8UC1) continue;
    if (x + kSide + kGap > image->cols) return;
    const cv::Rect place(x, y, kSide, kSide);
    cv::Mat patch;
    cv::resize(feature.template_image, patch, place.size(), 0, 0, cv::INTER_NEAREST);
    cv::cvtColor(patch, (*image)(place), cv::COLOR_GRAY2BGR);
    cv::rectangle(*image, place, statusColor(feature), 1);
    x += kSide + kGap;
  }
}

std::string shortCount(std::int64_t count) {
  char text[32];
  if (count < 1000000)
    std::snprintf(text, sizeof text, "%.1fk", count / 1e3);
  else
    std::snprintf(text, sizeof text, "%.1fM", count / 1e6);
  return text;
}

void drawStatus(const TrackedFrame& frame, cv::Mat* image) {
  const MatchStatistics& s = frame.matching.statistics;
  char numbers[160];
  std::snprintf(numbers, sizeof numbers, "  %d/%d matched  %s of %s px  %.1f ms", s.matched,
                s.candidates, shortCount(s.pixels_searched).c_str(),
                shortCount(s.pixels_full_gates).c_str(), frame.timings_ms.total);
  std::string text = trackingStateName(frame.state);
  if (frame.state == TrackingState::kTracking) {
    text += "  " + s.matcher + numbers;
    if (frame.scale_source == ScaleSource::kFree) text += "  scale free";
  } else {
    text += ": " + frame.reason;
  }
  const cv::Rect bar(0, 0, image->cols, 20);
  cv::Mat strip = (*image)(bar & cv::Rect(0, 0, image->cols, image->rows));
  strip *= 0.35;
  const bool well = frame.state == TrackingState::kTracking;
  const int width = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 1.0, 1, nullptr).width;
  const double size = std::min(0.43, (image->cols - 12.0) / std::max(1, width));
  cv::putText(*image, text, cv::Point(6, 14), cv::FONT_HERSHEY_SIMPLEX, size,
              well ? kWhite : kOrange, 1, cv::LINE_AA);
}

}  // namespace

EllipseAxes threeSigmaEllipse(const Eigen::Matrix2d& covariance_px2) {
  EllipseAxes axes;
  if (!covariance_px2.allFinite()) return axes;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance_px2);
  const Eigen::Vector2d roots = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector2d major = solver.eigenvectors().col(1);
  axes.major_px = 3.0 * roots[1];
  axes.minor_px = 3.0 * roots[0];
  axes.angle_deg = std::atan2(major.y(), major.x()) * 180.0 / M_PI;
  return axes;
}

cv::Mat drawDebugImage(const TrackedFrame& frame, const DrawOptions& options, int submap_level) {
  if (frame.image.empty()) return {};
  Canvas canvas(frame.image);
  if (options.links) drawLinks(frame, options.minimum_link_bits, &canvas);
  if (options.tree) drawTree(frame, &canvas);
  if (options.predictions)
    for (const TrackedFeature& feature : frame.features)
      if (feature.status != FeatureStatus::kNotVisible)
        canvas.ellipse(feature.predicted_px, feature.innovation_covariance_px2,
                       statusColor(feature));
  if (options.searches) drawSearches(frame, &canvas);
  if (options.matches) drawMatches(frame, &canvas);
  if (options.submaps) drawSubmaps(frame, submap_level, &canvas);
  if (options.information) {
    const auto bits_of = predictedInformationBits(frame);
    for (const TrackedFeature& feature : frame.features) {
      const auto bits = bits_of.find(feature.id);
      if (bits == bits_of.end()) continue;
      char text[16];
      std::snprintf(text, sizeof text, "%.1f", bits->second);
      canvas.label(feature.predicted_px, text, kWhite);
    }
  }
  if (options.templates) drawTemplates(frame, &canvas.image());
  if (options.status) drawStatus(frame, &canvas.image());
  return canvas.image();
}

}  // namespace active_matching_slam
