#include "active_matching_slam/evaluation/plot_canvas.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace active_matching_slam {
namespace {

constexpr int kShift = 4;  // sub-pixel bits of OpenCV's drawing functions
const cv::Scalar kGridColour(232, 232, 232), kFrameColour(120, 120, 120), kTextColour(40, 40, 40);

std::string tickText(double value, double step) {
  const int digits = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  char text[32];
  std::snprintf(text, sizeof(text), "%.*f", digits, std::abs(value) < 1e-9 * step ? 0.0 : value);
  return text;
}

}  // namespace

void putPlotText(cv::Mat* image, const std::string& text, cv::Point origin, double size) {
  cv::putText(*image, text, origin, cv::FONT_HERSHEY_SIMPLEX, size, kTextColour, 1, cv::LINE_AA);
}

int plotTextWidth(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline).width;
}

double roundLength(double length) {
  const double power = std::pow(10.0, std::floor(std::log10(length)));
  for (double factor : {5.0, 2.0})
    if (factor * power <= length * (1.0 + 1e-12)) return factor * power;
  return power;
}

PlotCanvas::PlotCanvas(cv::Mat* image, const cv::Rect& panel, const Eigen::Vector2d& center,
                       double pixels_per_unit)
    : image_(*image),
      panel_((*image)(panel)),
      rect_(panel),
      center_(center),
      pixels_per_unit_(pixels_per_unit) {}

Eigen::Vector2d PlotCanvas::pixel(const Eigen::Vector2d& position) const {
  // Far outside is kept within what fixed-point coordinates hold.
  const double reach = 1e5;
  return {std::clamp(0.5 * rect_.width + pixels_per_unit_ * (position.x() - center_.x()), -reach,
                     reach),
          std::clamp(0.5 * rect_.height - pixels_per_unit_ * (position.y() - center_.y()), -reach,
                     reach)};
}

cv::Point PlotCanvas::fixedPoint(const Eigen::Vector2d& position) const {
  const Eigen::Vector2d p = pixel(position) * (1 << kShift);
  return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
}

void PlotCanvas::drawGrid(const std::string& x_label, const std::string& y_label,
                          const std::string& title) {
  const double step = roundLength(110.0 / pixels_per_unit_);
  const double half_x = 0.5 * rect_.width / pixels_per_unit_;
  const double half_y = 0.5 * rect_.height / pixels_per_unit_;
  const int bottom = rect_.y + rect_.height;
  for (double k = std::ceil((center_.x() - half_x) / step); k * step <= center_.x() + half_x; ++k) {
    const int u = static_cast<int>(std::lround(pixel({k * step, 0.0}).x()));
    cv::line(panel_, {u, 0}, {u, rect_.height}, kGridColour, 1);
    const std::string text = tickText(k * step, step);
    putPlotText(&image_, text, {rect_.x + u - plotTextWidth(text, 0.42) / 2, bottom + 18}, 0.42);
  }
  for (double k = std::ceil((center_.y() - half_y) / step); k * step <= center_.y() + half_y; ++k) {
    const int v = static_cast<int>(std::lround(pixel({0.0, k * step}).y()));
    cv::line(panel_, {0, v}, {rect_.width, v}, kGridColour, 1);
    const std::string text = tickText(k * step, step);
    putPlotText(&image_, text, {rect_.x - 8 - plotTextWidth(text, 0.42), rect_.y + v + 5}, 0.42);
  }
  putPlotText(&image_, x_label, {rect_.x + rect_.width - plotTextWidth(x_label, 0.5), bottom + 40},
              0.5);
  putPlotText(&image_, y_label, {rect_.x, rect_.y - 8}, 0.5);
  putPlotText(&image_, title, {rect_.x + rect_.width - plotTextWidth(title, 0.5), rect_.y - 8},
              0.5);
}

void PlotCanvas::drawFrame() { cv::rectangle(image_, rect_, kFrameColour, 1); }

void PlotCanvas::drawScaleBar(const std::string& unit) {
  const double length = roundLength(0.25 * rect_.width / pixels_per_unit_);
  const int width = static_cast<int>(std::lround(length * pixels_per_unit_));
  const std::string text = tickText(length, length) + " " + unit;
  const cv::Point right(rect_.width - 24, rect_.height - 22), left = right - cv::Point(width, 0);
  const int text_width = plotTextWidth(text, 0.45);
  const int box_width = std::max(width, text_width);
  cv::rectangle(panel_, cv::Point(right.x - box_width - 12, right.y - 28),
                right + cv::Point(12, 12), cv::Scalar(255, 255, 255), cv::FILLED);
  cv::line(panel_, left, right, kTextColour, 2, cv::LINE_AA);
  for (const cv::Point& end : {left, right})
    cv::line(panel_, end - cv::Point(0, 5), end + cv::Point(0, 5), kTextColour, 2, cv::LINE_AA);
  putPlotText(&panel_, text, {(left.x + right.x - text_width) / 2, right.y - 12}, 0.45);
}

void PlotCanvas::polyline(const std::vector<Eigen::Vector2d>& line, const cv::Scalar& colour,
                          int thickness) {
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& p : line) points.push_back(fixedPoint(p));
  cv::polylines(panel_, points, false, colour, thickness, cv::LINE_AA, kShift);
}

void PlotCanvas::dot(const Eigen::Vector2d& position, double radius_px, const cv::Scalar& colour) {
  cv::circle(panel_, fixedPoint(position), static_cast<int>(std::lround(radius_px * (1 << kShift))),
             colour, cv::FILLED, cv::LINE_AA, kShift);
}

void PlotCanvas::ring(const Eigen::Vector2d& position, double radius_px, const cv::Scalar& colour) {
  dot(position, radius_px, cv::Scalar(255, 255, 255));
  cv::circle(panel_, fixedPoint(position), static_cast<int>(std::lround(radius_px * (1 << kShift))),
             colour, 2, cv::LINE_AA, kShift);
}

void PlotCanvas::square(const Eigen::Vector2d& position, double half_px, const cv::Scalar& colour) {
  const Eigen::Vector2d center = pixel(position);
  const cv::Point half(static_cast<int>(half_px), static_cast<int>(half_px));
  const cv::Point p(static_cast<int>(std::lround(center.x())),
                    static_cast<int>(std::lround(center.y())));
  cv::rectangle(panel_, p - half, p + half, colour, cv::FILLED, cv::LINE_AA);
}

}  // namespace active_matching_slam
