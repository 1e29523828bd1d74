#include "active_matching_slam/image/corners.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>

namespace active_matching_slam {
namespace {

constexpr int kTensorWindow = 5;  // [px]
constexpr int kSmallestCell = 32;
constexpr int kRefinements = 2;      ///< iterations of a corner's refinement
constexpr double kFarthestPx = 3.0;  ///< of that from the corner found

/// A part of the image that may give one corner.
struct Cell {
  cv::Rect area;
  Eigen::Vector2d center;
  double emptiness = 0.0;  ///< squared distance of its centre to what is nearest
  cv::Mat response;        ///< with a rim of one pixel
};

double squaredDistanceToNearest(const Eigen::Vector2d& point,
                                const std::vector<Eigen::Vector2d>& others) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& other : others)
    nearest = std::min(nearest, (point - other).squaredNorm());
  return nearest;
}

std::vector<Cell> cutIntoCells(const cv::Rect& area, int side) {
  const int columns = std::max(1, area.width / side), rows = std::max(1, area.height / side);
  std::vector<Cell> cells;
  cells.reserve(columns * rows);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int left = area.width * i / columns, right = area.width * (i + 1) / columns;
      const int top = area.height * j / rows, bottom = area.height * (j + 1) / rows;
      cells.push_back({{area.x + left, area.y + top, right - left, bottom - top},
                       {area.x + 0.5 * (left + right), area.y + 0.5 * (top + bottom)},
                       0.0,
                       {}});
    }
  return cells;
}

/// Orders the cells so that each is the one farthest from all points and all cells before it.
void orderByEmptiness(const std::vector<Eigen::Vector2d>& points, std::vector<Cell>* cells) {
  for (Cell& cell : *cells) cell.emptiness = squaredDistanceToNearest(cell.center, points);
  for (auto next = cells->begin(); next != cells->end(); ++next) {
    const auto emptiest = std::max_element(next, cells->end(), [](const Cell& a, const Cell& b) {
      return std::make_tuple(a.emptiness, -a.area.y, -a.area.x) <
             std::make_tuple(b.emptiness, -b.area.y, -b.area.x);
    });
    std::iter_swap(next, emptiest);
    for (auto cell = next + 1; cell != cells->end(); ++cell)
      cell->emptiness = std::min(cell->emptiness, (cell->center - next->center).squaredNorm());
  }
}

/// Standard deviation of the template-sized window around a pixel.
double contrastAround(const cv::Mat& image, int u, int v, int size) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(image(cv::Rect(u - size / 2, v - size / 2, size, size)), mean, deviation);
  return deviation[0];
}

/// The cell's strongest local maximum of the response that keeps its distance; response 0 when
/// none.
Corner strongestCorner(const Cell& cell, const std::vector<Eigen::Vector2d>& occupied,
                       double squared_distance) {
  std::vector<Eigen::Vector2d> nearby;
  const Eigen::Vector2d low(cell.area.x, cell.area.y);
  const Eigen::Vector2d high(cell.area.x + cell.area.width - 1, cell.area.y + cell.area.height - 1);
  for (const Eigen::Vector2d& point : occupied)
    if ((point.cwiseMax(low).cwiseMin(high) - point).squaredNorm() < squared_distance)
      nearby.push_back(point);
  Corner best;
  for (int j = 0; j < cell.area.height; ++j) {
    const float* above = cell.response.ptr<float>(j);
    const float* row = cell.response.ptr<float>(j + 1);
    const float* below = cell.response.ptr<float>(j + 2);
    for (int i = 0; i < cell.area.width; ++i) {
      const float value = row[i + 1];
      if (!(value > best.response)) continue;
      const float around = std::max({above[i], above[i + 1], above[i + 2], row[i], row[i + 2],
                                     below[i], below[i + 1], below[i + 2]});
      const Eigen::Vector2d pixel(cell.area.x + i, cell.area.y + j);
      if (value < around || squaredDistanceToNearest(pixel, nearby) < squared_distance) continue;
      best = {pixel, value};
    }
  }
  return best;
}

/// Least squares move a template by A^-1 sum(g g^T M (x - p)) where the image is warped about p by
/// I + M unforeseen, g: gradient at x, A = sum(g g^T). Of all small M alike, the expected square of
/// that is least for p_k = tr(A^-1 sum(g g^T x_k)) / 2. Empty when the window does not determine
/// it.
std::optional<Eigen::Vector2d> steadiestPoint(const cv::Mat& image, const Eigen::Vector2d& middle,
                                              int size) {
  const int u = static_cast<int>(middle.x()), v = static_cast<int>(middle.y()), half = size / 2;
  if (u <= half || v <= half || u + half + 1 >= image.cols || v + half + 1 >= image.rows)
    return std::nullopt;
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero(), by_u = A, by_v = A;
  for (int dv = -half; dv <= half; ++dv) {
    const std::uint8_t* above = image.ptr<std::uint8_t>(v + dv - 1) + u;
    const std::uint8_t* row = image.ptr<std::uint8_t>(v + dv) + u;
    const std::uint8_t* below = image.ptr<std::uint8_t>(v + dv + 1) + u;
    for (int du = -half; du <= half; ++du) {
      const Eigen::Vector2d g(row[du + 1] - row[du - 1], below[du] - above[du]);
      const Eigen::Matrix2d tensor = g * g.transpose();
      A += tensor;
      by_u += du * tensor;
      by_v += dv * tensor;
    }
  }
  const Eigen::Matrix2d inverse = A.inverse();
  const Eigen::Vector2d shift(0.5 * (inverse * by_u).trace(), 0.5 * (inverse * by_v).trace());
  if (!shift.allFinite()) return std::nullopt;
  return middle + shift;
}

/// The corner moved to where template alignment is least sensitive to warps, or as it was where
/// that is too far or not allowed.
Corner refined(const Corner& corner, const cv::Mat& image, const cv::Rect& area,
               const std::vector<Eigen::Vector2d>& occupied, double squared_distance, int size,
               const cv::Mat& centres) {
  Corner moved = corner;
  for (int k = 0; k < kRefinements; ++k) {
    const auto point = steadiestPoint(image, moved.pixel, size);
    if (!point || !((*point - corner.pixel).norm() <= kFarthestPx)) return corner;
    moved.pixel = {std::round(point->x()), std::round(point->y())};
  }
  const cv::Point place(static_cast<int>(moved.pixel.x()), static_cast<int>(moved.pixel.y()));
  const bool is_inside =
      area.contains(place) && (centres.empty() || centres.at<std::uint8_t>(place) != 0);
  return is_inside && squaredDistanceToNearest(moved.pixel, occupied) >= squared_distance ? moved
                                                                                          : corner;
}

}  // namespace

std::vector<Corner> detectCorners(const cv::Mat& image,
                                  const std::vector<Eigen::Vector2d>& occupied, int wanted,
                                  double minimum_distance_px, const ImageOptions& options,
                                  const cv::Mat& centres) {
  std::vector<Corner> corners;
  const int border = std::max(options.border_px, options.source_patch_size_px / 2) + 1;
  const cv::Rect area(border, border, image.cols - 2 * border, image.rows - 2 * border);
  if (image.type() != CV_8UC1 || wanted <= 0 || area.width <= 0 || area.height <= 0) return corners;

  const double squared_distance = minimum_distance_px * minimum_distance_px;
  std::vector<Eigen::Vector2d> taken;
  for (const Eigen::Vector2d& point : occupied)
    if (point.allFinite()) taken.push_back(point);

  std::vector<Cell> cells =
      cutIntoCells(area, std::max(kSmallestCell, static_cast<int>(2.0 * minimum_distance_px)));
  orderByEmptiness(taken, &cells);

  // Some more cells than corners wanted at a time: what is strong is known by comparison.
  const std::size_t batch = std::max<std::size_t>(12, 2 * static_cast<std::size_t>(wanted));
  double strongest = 0.0;
  for (std::size_t begin = 0; begin < cells.size(); begin += batch) {
    const std::size_t end = std::min(begin + batch, cells.size());
    for (std::size_t i = begin; i < end; ++i) {
      const cv::Rect& cell = cells[i].area;
      const cv::Rect rim(cell.x - 1, cell.y - 1, cell.width + 2, cell.height + 2);
      cv::cornerMinEigenVal(image(rim), cells[i].response, kTensorWindow);
      if (!centres.empty()) cells[i].response.setTo(0.0, centres(rim) == 0);
      double most = 0.0;
      cv::minMaxLoc(cells[i].response, nullptr, &most);
      strongest = std::max(strongest, most);
    }
    for (std::size_t i = begin; i < end; ++i) {
      Corner corner = strongestCorner(cells[i], taken, squared_distance);
      cells[i].response.release();
      if (corner.response <= 0.0 || corner.response < options.corner_quality * strongest) continue;
      if (contrastAround(image, static_cast<int>(corner.pixel.x()),
                         static_cast<int>(corner.pixel.y()),
                         options.template_size_px) < options.minimum_contrast)
        continue;
      corner =
          refined(corner, image, area, taken, squared_distance, options.template_size_px, centres);
      corners.push_back(corner);
      taken.push_back(corner.pixel);
      if (static_cast<int>(corners.size()) == wanted) return corners;
    }
  }
  return corners;
}

}  // namespace active_matching_slam
