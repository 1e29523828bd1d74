#include "active_matching_slam/evaluation/chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "active_matching_slam/evaluation/plot_canvas.h"

namespace active_matching_slam {
namespace {

constexpr int kLeft = 76, kRight = 16, kTop = 44, kBottom = 54;
const cv::Scalar kGrid(232, 232, 232), kFrame(120, 120, 120);

cv::Scalar colourOf(std::size_t series) {
  static const cv::Scalar colours[] = {{180, 90, 20},  {30, 110, 240}, {60, 150, 40},
                                       {40, 40, 200},  {170, 60, 140}, {70, 90, 120},
                                       {190, 170, 30}, {90, 90, 90}};
  return colours[series % (sizeof(colours) / sizeof(colours[0]))];
}

/// Values of one axis to the unit interval.
class Axis {
 public:
  /// `values`: finite, and positive on a logarithmic axis.
  Axis(const std::vector<double>& values, bool logarithmic, bool from_zero)
      : logarithmic_(logarithmic) {
    low_ = std::numeric_limits<double>::infinity();
    high_ = -low_;
    for (const double value : values) {
      low_ = std::min(low_, position(value));
      high_ = std::max(high_, position(value));
    }
    if (low_ > high_) low_ = 0.0, high_ = 1.0;
    if (from_zero && !logarithmic) low_ = std::min(low_, 0.0);
    if (high_ - low_ < 1e-12 * (1.0 + std::abs(high_))) low_ -= 0.5, high_ += 0.5;
    const double margin = 0.05 * (high_ - low_);
    if (!from_zero || low_ != 0.0 || logarithmic) low_ -= margin;
    high_ += margin;
  }

  double span() const { return high_ - low_; }
  /// Shows more, the same in the middle.
  void widen(double span) {
    const double middle = 0.5 * (low_ + high_);
    low_ = middle - 0.5 * span;
    high_ = middle + 0.5 * span;
  }
  double unit(double value) const { return (position(value) - low_) / (high_ - low_); }

  std::vector<double> ticks() const {
    std::vector<double> ticks;
    if (!logarithmic_) {
      const double step = roundLength(span() / 4.0);
      for (double k = std::ceil(low_ / step); k * step <= high_; ++k) ticks.push_back(k * step);
      return ticks;
    }
    const bool decades = span() > 3.0;
    for (int power = static_cast<int>(std::floor(low_)); power <= high_; ++power)
      for (const double factor : {1.0, 2.0, 5.0}) {
        const double value = factor * std::pow(10.0, power);
        if ((factor == 1.0 || !decades) && position(value) >= low_ && position(value) <= high_)
          ticks.push_back(value);
      }
    return ticks;
  }

 private:
  double position(double value) const { return logarithmic_ ? std::log10(value) : value; }

  bool logarithmic_;
  double low_, high_;
};

std::string tickText(double value) {
  if (std::abs(value) < 1e-12) return "0";
  char text[32];
  if (std::abs(value) >= 1e5 || std::abs(value) < 1e-3)
    std::snprintf(text, sizeof(text), "%.1e", value);
  else
    std::snprintf(text, sizeof(text), "%.4g", value);
  return text;
}

/// A white picture with title and labels around the panel that is drawn into.
struct Sheet {
  Sheet(int width_px, int height_px, const std::string& title, const std::string& x_label,
        const std::string& y_label)
      : picture(height_px, width_px, CV_8UC3, cv::Scalar::all(255)),
        panel(kLeft, kTop, width_px - kLeft - kRight, height_px - kTop - kBottom) {
    putPlotText(&picture, title, {kLeft, 18}, 0.5);
    putPlotText(&picture, y_label, {8, kTop - 8}, 0.45);
    putPlotText(&picture, x_label,
                {panel.x + panel.width - plotTextWidth(x_label, 0.45), height_px - 12}, 0.45);
  }

  void drawYTicks(const Axis& axis, bool y_down) {
    for (const double value : axis.ticks()) {
      const int v = row(axis.unit(value), y_down);
      cv::line(picture, {panel.x, v}, {panel.x + panel.width, v}, kGrid, 1);
      const std::string text = tickText(value);
      putPlotText(&picture, text, {panel.x - 6 - plotTextWidth(text, 0.4), v + 5}, 0.4);
    }
  }
  void drawXText(const std::string& text, double u) {
    putPlotText(&picture, text,
                {static_cast<int>(std::lround(u)) - plotTextWidth(text, 0.4) / 2,
                 panel.y + panel.height + 18},
                0.4);
  }
  int row(double unit, bool y_down) const {
    const double fraction = y_down ? unit : 1.0 - unit;
    return panel.y + static_cast<int>(std::lround(fraction * panel.height));
  }

  /// Names on a translucent ground in the upper right corner.
  void drawLegend(const std::vector<std::string>& names) {
    int width = 0;
    for (const std::string& name : names) width = std::max(width, plotTextWidth(name, 0.42));
    if (names.empty()) return;
    const cv::Rect box(panel.x + panel.width - width - 42, panel.y + 6, width + 36,
                       18 * static_cast<int>(names.size()) + 8);
    cv::Mat ground = picture(box & cv::Rect({0, 0}, picture.size()));
    ground = 0.25 * ground + cv::Scalar::all(0.75 * 255);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const int v = box.y + 16 + 18 * static_cast<int>(i);
      cv::rectangle(picture, cv::Rect(box.x + 6, v - 9, 16, 9), colourOf(i), cv::FILLED);
      putPlotText(&picture, names[i], {box.x + 28, v}, 0.42);
    }
  }

  cv::Mat picture;
  cv::Rect panel;
};

}  // namespace

cv::Mat drawLineChart(const LineChart& chart, int width_px, int height_px) {
  Sheet sheet(width_px, height_px, chart.title, chart.x_label, chart.y_label);
  const cv::Rect& panel = sheet.panel;
  const auto isShown = [&](const Eigen::Vector2d& point) {
    return point.allFinite() && (!chart.log_x || point.x() > 0.0) &&
           (!chart.log_y || point.y() > 0.0);
  };
  std::vector<double> xs, ys;
  for (const ChartSeries& series : chart.series)
    for (const Eigen::Vector2d& point : series.points) {
      if (!isShown(point)) continue;
      xs.push_back(point.x());
      ys.push_back(point.y());
    }
  Axis x(xs, chart.log_x, false), y(ys, chart.log_y, !chart.equal_axes);
  if (chart.equal_axes) {
    const double per_px = std::max(x.span() / panel.width, y.span() / panel.height);
    x.widen(per_px * panel.width);
    y.widen(per_px * panel.height);
  }
  const auto column = [&](double value) { return panel.x + x.unit(value) * panel.width; };
  sheet.drawYTicks(y, chart.y_down);
  for (const double value : x.ticks()) {
    const int u = static_cast<int>(std::lround(column(value)));
    cv::line(sheet.picture, {u, panel.y}, {u, panel.y + panel.height}, kGrid, 1);
    sheet.drawXText(tickText(value), u);
  }
  std::vector<std::string> names;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    std::vector<cv::Point> line;
    for (const Eigen::Vector2d& point : chart.series[s].points)
      if (isShown(point))
        line.emplace_back(static_cast<int>(std::lround(column(point.x()))),
                          sheet.row(y.unit(point.y()), chart.y_down));
    cv::polylines(sheet.picture, line, false, colourOf(s), 2, cv::LINE_AA);
    if (chart.markers)
      for (const cv::Point& point : line)
        cv::circle(sheet.picture, point, 4, colourOf(s), cv::FILLED, cv::LINE_AA);
    names.push_back(chart.series[s].name);
  }
  cv::rectangle(sheet.picture, panel, kFrame, 1);
  sheet.drawLegend(names);
  return sheet.picture;
}

cv::Mat drawBarChart(const BarChart& chart, int width_px, int height_px) {
  Sheet sheet(width_px, height_px, chart.title, chart.x_label, chart.y_label);
  const cv::Rect& panel = sheet.panel;
  const auto valueOf = [](double value) {
    return std::isfinite(value) ? std::max(0.0, value) : 0.0;
  };
  std::vector<double> totals;
  for (const ChartBar& bar : chart.bars) {
    totals.push_back(0.0);
    for (const double value : bar.values) totals.back() += valueOf(value);
  }
  // Room for the legend above the bars.
  const double highest = totals.empty() ? 1.0 : *std::max_element(totals.begin(), totals.end());
  totals.push_back(highest * (1.0 + 0.09 * static_cast<double>(chart.parts.size())));
  const Axis y(totals, false, true);
  sheet.drawYTicks(y, false);
  const double step = panel.width / std::max(1.0, static_cast<double>(chart.bars.size()));
  for (std::size_t b = 0; b < chart.bars.size(); ++b) {
    const double middle = panel.x + (static_cast<double>(b) + 0.5) * step;
    const int left = static_cast<int>(std::lround(middle - 0.36 * step));
    const int right = static_cast<int>(std::lround(middle + 0.36 * step));
    double below = 0.0;
    for (std::size_t part = 0; part < chart.bars[b].values.size(); ++part) {
      const double above = below + valueOf(chart.bars[b].values[part]);
      const cv::Point upper(left, sheet.row(y.unit(above), false));
      const cv::Point lower(right, sheet.row(y.unit(below), false));
      if (above > below) cv::rectangle(sheet.picture, upper, lower, colourOf(part), cv::FILLED);
      below = above;
    }
    sheet.drawXText(chart.bars[b].name, middle);
  }
  cv::rectangle(sheet.picture, panel, kFrame, 1);
  sheet.drawLegend(chart.parts);
  return sheet.picture;
}

cv::Mat tilePictures(const std::vector<cv::Mat>& pictures, int columns) {
  if (columns < 1)
    throw std::invalid_argument("columns is " + std::to_string(columns) + ", must be at least 1");
  int width = 0, height = 0;
  for (const cv::Mat& picture : pictures) {
    width = std::max(width, picture.cols);
    height = std::max(height, picture.rows);
  }
  const int count = static_cast<int>(pictures.size());
  const int rows = (count + columns - 1) / columns;
  cv::Mat sheet(std::max(1, rows * height), std::max(1, std::min(count, columns) * width), CV_8UC3,
                cv::Scalar::all(255));
  for (int i = 0; i < count; ++i) {
    const cv::Mat& picture = pictures[static_cast<std::size_t>(i)];
    picture.copyTo(
        sheet(cv::Rect((i % columns) * width, (i / columns) * height, picture.cols, picture.rows)));
  }
  return sheet;
}

void writePicture(const std::string& path, const cv::Mat& picture) {
  bool written = false;
  try {
    written = cv::imwrite(path, picture);
  } catch (const cv::Exception&) {
  }
  if (!written) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace active_matching_slam
