#include "active_matching_slam/visualisation/debug_canvas.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kWidth = 640;  ///< in units
constexpr int kShift = 4;    ///< drawing coordinates in sixteenths of a pixel
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kInk(225, 225, 225), kPaper(28, 24, 22);

int toFixed(double value) { return cvRound(value * (1 << kShift)); }

bool isDrawable(const Eigen::Vector2d& pixel) {
  return pixel.allFinite() && pixel.cwiseAbs().maxCoeff() < 1e4;
}

/// `size` [1/640 of the width] is that of cv::putText's font for a picture of 640 pixels.
void write(cv::Mat* image, const std::string& text, const cv::Point& corner, double size,
           const cv::Scalar& color, double unit, int extra_width = 0) {
  cv::putText(*image, text, corner, kFont, size * unit, color,
              std::max(1, cvRound(unit)) + extra_width, cv::LINE_AA);
}

int widthOf(const std::string& text, double size, double unit) {
  return cv::getTextSize(text, kFont, size * unit, std::max(1, cvRound(unit)), nullptr).width;
}

/// Marks of the legend, left to right, in as many colours as fit.
void drawSymbol(const LegendEntry& entry, double unit, const cv::Point& center, cv::Mat* image) {
  const int r = cvRound(4 * unit), width = std::max(1, cvRound(unit));
  switch (entry.symbol) {
    case LegendEntry::Symbol::kNone:
      break;
    case LegendEntry::Symbol::kEllipse:
    case LegendEntry::Symbol::kDot: {
      const bool is_dot = entry.symbol == LegendEntry::Symbol::kDot;
      for (int i = -1; i <= 1; ++i) {
        const bool varies = entry.color(0.0) != entry.color(1.0);
        if (i != 0 && !varies) continue;
        cv::circle(*image, center + cv::Point(cvRound(6 * unit) * i, 0), is_dot ? r / 2 : r,
                   entry.color(0.5 + 0.5 * i), is_dot ? cv::FILLED : width, cv::LINE_AA);
      }
      break;
    }
    case LegendEntry::Symbol::kCross:
      cv::drawMarker(*image, center, entry.color(0.0), cv::MARKER_TILTED_CROSS, 2 * r, width,
                     cv::LINE_AA);
      break;
    case LegendEntry::Symbol::kDiamond:
      cv::drawMarker(*image, center, entry.color(0.0), cv::MARKER_DIAMOND, 2 * r, width,
                     cv::LINE_AA);
      break;
    case LegendEntry::Symbol::kLine:
      for (int x = -2 * r; x < 2 * r; ++x)
        cv::line(*image, center + cv::Point(x, 0), center + cv::Point(x + 1, 0),
                 entry.color(0.5 + 0.25 * x / r), 2 * width);
  }
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

DebugCanvas::DebugCanvas(const cv::Mat& gray)
    : scale_(std::clamp((kWidth + gray.cols - 1) / gray.cols, 1, 4)) {
  cv::Mat large;
  cv::resize(gray, large, cv::Size(), scale_, scale_, cv::INTER_LINEAR);
  cv::cvtColor(large, image_, cv::COLOR_GRAY2BGR);
  unit_ = static_cast<double>(image_.cols) / kWidth;
}

void DebugCanvas::ellipse(const Eigen::Vector2d& center, const Eigen::Matrix2d& covariance_px2,
                          const cv::Scalar& color) {
  const EllipseAxes axes = threeSigmaEllipse(covariance_px2);
  const double limit = 4.0 * image_.cols;
  if (!isDrawable(center) || !(axes.major_px * scale_ < limit)) return;
  const cv::Size size(toFixed(axes.major_px * scale_), toFixed(axes.minor_px * scale_));
  cv::ellipse(image_, at(center), size, axes.angle_deg, 0, 360, color, thickness(1.0), cv::LINE_AA,
              kShift);
}

void DebugCanvas::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                       const cv::Scalar& color, double width) {
  if (isDrawable(from) && isDrawable(to))
    cv::line(image_, at(from), at(to), color, thickness(width), cv::LINE_AA, kShift);
}

void DebugCanvas::dot(const Eigen::Vector2d& center, double radius, const cv::Scalar& color) {
  if (isDrawable(center))
    cv::circle(image_, at(center), toFixed(radius * unit_), color, cv::FILLED, cv::LINE_AA, kShift);
}

void DebugCanvas::cross(const Eigen::Vector2d& center, double radius, const cv::Scalar& color) {
  const double r = inPixels(radius);
  line(center + Eigen::Vector2d(-r, -r), center + Eigen::Vector2d(r, r), color);
  line(center + Eigen::Vector2d(-r, r), center + Eigen::Vector2d(r, -r), color);
}

void DebugCanvas::diamond(const Eigen::Vector2d& center, double radius, const cv::Scalar& color) {
  const double r = inPixels(radius);
  const Eigen::Vector2d corners[] = {{r, 0}, {0, r}, {-r, 0}, {0, -r}};
  for (int i = 0; i < 4; ++i) line(center + corners[i], center + corners[(i + 1) % 4], color);
}

void DebugCanvas::label(const Eigen::Vector2d& position, const std::string& text,
                        const cv::Scalar& color) {
  if (!isDrawable(position)) return;
  constexpr double kSize = 0.34;
  const int gap = cvRound(4 * unit_);
  cv::Point corner = at(position);
  corner = cv::Point((corner.x >> kShift) + gap, (corner.y >> kShift) - gap);
  write(&image_, text, corner, kSize, kPaper, unit_, 2);
  write(&image_, text, corner, kSize, color, unit_);
}

cv::Point DebugCanvas::at(const Eigen::Vector2d& pixel) const {
  return {toFixed((pixel.x() + 0.5) * scale_ - 0.5), toFixed((pixel.y() + 0.5) * scale_ - 0.5)};
}

int DebugCanvas::thickness(double width) const { return std::max(1, cvRound(width * unit_)); }

cv::Mat withFooter(const cv::Mat& picture, double unit, const std::string& status,
                   const cv::Scalar& status_color, const std::vector<LegendEntry>& legend) {
  constexpr double kStatusSize = 0.43, kLegendSize = 0.36;
  const int margin = cvRound(6 * unit), row = cvRound(17 * unit), symbol = cvRound(26 * unit);
  // Where each entry goes: a row of its own when the one before is full.
  std::vector<cv::Point> places;
  int x = margin, y = status.empty() ? 0 : row;
  for (const LegendEntry& entry : legend) {
    const int width = symbol + widthOf(entry.text, kLegendSize, unit) + 2 * margin;
    if (x + width > picture.cols && x > margin) {
      x = margin;
      y += row;
    }
    places.emplace_back(x, y);
    x += width;
  }
  const int height = legend.empty() ? y : y + row;
  if (height == 0) return picture;
  cv::Mat image;
  cv::copyMakeBorder(picture, image, 0, height, 0, 0, cv::BORDER_CONSTANT, kPaper);
  const cv::Point origin(0, picture.rows), baseline(0, cvRound(12 * unit));
  if (!status.empty()) {
    const double fit =
        (picture.cols - 2.0 * margin) / std::max(1, widthOf(status, kStatusSize, unit));
    write(&image, status, origin + baseline + cv::Point(margin, 0),
          kStatusSize * std::min(1.0, fit), status_color, unit);
  }
  for (std::size_t i = 0; i < legend.size(); ++i) {
    const cv::Point corner = origin + places[i];
    drawSymbol(legend[i], unit, corner + cv::Point(symbol / 2 - cvRound(2 * unit), row / 2),
               &image);
    write(&image, legend[i].text, corner + baseline + cv::Point(symbol, 0), kLegendSize, kInk,
          unit);
  }
  return image;
}

}  // namespace active_matching_slam
