#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/textures.h"

namespace active_matching_slam {
namespace {

cv::Mat blank(const Canvas& canvas, double level) {
  return cv::Mat(canvas.size(), CV_32FC1, cv::Scalar(level));
}

/// Several octaves of noise, from `cell_m` down to the texel.
void addFractal(cv::Mat& image, const Canvas& c, double cell_m, int octaves, double sigma) {
  for (int i = 0; i < octaves; ++i)
    addNoise(image, c.texels_per_m, cell_m / (1 << i), cell_m / (1 << i), sigma / (1.0 + 0.6 * i),
             c.seed * 31 + i);
}

cv::Mat& clampUnit(cv::Mat& image) {
  cv::min(image, 1.0, image);
  cv::max(image, 0.0, image);
  return image;
}

/// Grains, specks, hairs: short strokes in random places.
void addStrokes(cv::Mat& image, const Canvas& c, double per_m2, double length_m, double spread,
                double sigma, bool vertical = false) {
  Random random = Random(c.seed).fork(77);
  const int count = static_cast<int>(per_m2 * c.width_m * c.height_m);
  for (int i = 0; i < count; ++i) {
    const cv::Point2d from(random.uniform(0.0, image.cols), random.uniform(0.0, image.rows));
    const double angle = vertical ? -0.5 * M_PI + random.uniform(-0.5, 0.5) * spread
                                  : random.uniform(0.0, 2.0 * M_PI) * spread;
    const double length = length_m * c.texels_per_m * random.uniform(0.4, 1.3);
    const cv::Point to(cvRound(from.x + length * std::cos(angle)),
                       cvRound(from.y + length * std::sin(angle)));
    const cv::Point start(cvRound(from.x), cvRound(from.y));
    const double level =
        image.at<float>(std::min(start.y, image.rows - 1), std::min(start.x, image.cols - 1)) +
        random.uniform(-1.7, 1.7) * sigma;
    cv::line(image, start, to, cv::Scalar(std::clamp(level, 0.02, 0.98)), 1, cv::LINE_8);
  }
}

/// Stones of Worley's cellular noise: each cell a grey of its own, dark joints between.
cv::Mat paintCells(const Canvas& c, double cell_m, double joint, double low, double high) {
  const cv::Size size = c.size();
  const double cell = cell_m * c.texels_per_m;
  const int columns = static_cast<int>(size.width / cell) + 3;
  const int rows = static_cast<int>(size.height / cell) + 3;
  struct Seed {
    double x, y, level;
  };
  std::vector<Seed> seeds;
  Random random = Random(c.seed).fork(5);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      seeds.push_back({(i - 1 + random.uniform(0.1, 0.9)) * cell,
                       (j - 1 + random.uniform(0.1, 0.9)) * cell, random.uniform(low, high)});
  cv::Mat image(size, CV_32FC1);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const int ci = static_cast<int>(x / cell) + 1, cj = static_cast<int>(y / cell) + 1;
      double nearest = std::numeric_limits<double>::max(), second = nearest, level = 0.0;
      for (int j = std::max(cj - 1, 0); j <= std::min(cj + 1, rows - 1); ++j)
        for (int i = std::max(ci - 1, 0); i <= std::min(ci + 1, columns - 1); ++i) {
          const Seed& s = seeds[j * columns + i];
          const double d = (s.x - x) * (s.x - x) + (s.y - y) * (s.y - y);
          if (d < nearest) {
            second = nearest;
            nearest = d;
            level = s.level;
          } else if (d < second) {
            second = d;
          }
        }
      const double edge = std::min(1.0, (std::sqrt(second) - std::sqrt(nearest)) / (joint * cell));
      image.at<float>(y, x) = static_cast<float>(level * (0.35 + 0.65 * edge));
    }
  return image;
}

}  // namespace

cv::Size Canvas::size() const {
  return {std::max(2, cvRound(width_m * texels_per_m)),
          std::max(2, cvRound(height_m * texels_per_m))};
}

void addNoise(cv::Mat& image, double texels_per_m, double cell_u_m, double cell_v_m, double sigma,
              std::uint64_t seed) {
  const auto nodes = [texels_per_m](int texels, double cell_m) {
    return std::clamp(static_cast<int>(std::ceil(texels / (cell_m * texels_per_m))) + 1, 2, texels);
  };
  cv::Mat coarse(nodes(image.rows, cell_v_m), nodes(image.cols, cell_u_m), CV_32FC1);
  Random random = Random(seed).fork(0x4E4F);
  const double half_width = sigma * std::sqrt(3.0) * 1.25;  // interpolation smooths a little away
  for (int y = 0; y < coarse.rows; ++y)
    for (int x = 0; x < coarse.cols; ++x)
      coarse.at<float>(y, x) = static_cast<float>(random.uniform(-half_width, half_width));
  cv::Mat fine;
  cv::resize(coarse, fine, image.size(), 0, 0, cv::INTER_CUBIC);
  image += fine;
}

cv::Mat paintPlain(const Canvas& c, double level, double grain) {
  cv::Mat image = blank(c, level);
  addFractal(image, c, 0.15, 2, 0.5 * grain);
  addNoise(image, c.texels_per_m, 0.004, 0.004, grain, c.seed + 9);
  return clampUnit(image);
}

cv::Mat paintPlaster(const Canvas& c, double level) {
  cv::Mat image = blank(c, level);
  addFractal(image, c, 0.8, 5, 0.014);
  addNoise(image, c.texels_per_m, 0.006, 0.006, 0.018, c.seed + 9);
  addStrokes(image, c, 8.0, 0.03, 1.0, 0.12);
  return clampUnit(image);
}

cv::Mat paintConcrete(const Canvas& c) {
  cv::Mat image = blank(c, 0.5);
  addFractal(image, c, 1.2, 6, 0.035);
  addStrokes(image, c, 250.0, 0.008, 1.0, 0.16);
  // Formwork joints and anchor holes.
  const double px = c.texels_per_m;
  for (double x = 1.2; x < c.width_m; x += 1.2)
    cv::line(image, cv::Point(cvRound(x * px), 0), cv::Point(cvRound(x * px), image.rows),
             cv::Scalar(0.25), std::max(1, cvRound(0.008 * px)));
  for (double x = 0.3; x < c.width_m; x += 0.6)
    for (double y = 0.4; y < c.height_m; y += 0.9)
      cv::circle(image, cv::Point(cvRound(x * px), cvRound(y * px)),
                 std::max(1, cvRound(0.018 * px)), cv::Scalar(0.16), cv::FILLED, cv::LINE_AA);
  return clampUnit(image);
}

cv::Mat paintBricks(const Canvas& c) {
  constexpr double kLength = 0.25, kCourse = 0.075, kJoint = 0.012;
  Random random = Random(c.seed).fork(3);
  cv::Mat image = blank(c, 0.62);
  addNoise(image, c.texels_per_m, 0.01, 0.01, 0.06, c.seed + 1);
  const double px = c.texels_per_m;
  for (int row = 0; row * kCourse < c.height_m; ++row)
    for (int column = -1; column * kLength < c.width_m; ++column) {
      const double x = (column + 0.5 * (row % 2)) * kLength + random.uniform(-0.003, 0.003);
      const double y = row * kCourse + random.uniform(-0.002, 0.002);
      const cv::Point from(cvRound((x + kJoint) * px), cvRound((y + kJoint) * px));
      const cv::Point to(cvRound((x + kLength) * px), cvRound((y + kCourse) * px));
      double level = 0.34 + random.uniform(-0.09, 0.09);
      if (random.uniform() < 0.12) level += random.sign() * 0.14;
      cv::rectangle(image, from, to, cv::Scalar(level), cv::FILLED);
    }
  addFractal(image, c, 0.05, 3, 0.022);
  addFractal(image, c, 1.0, 2, 0.025);
  addStrokes(image, c, 500.0, 0.012, 1.0, 0.1);
  return clampUnit(image);
}

cv::Mat paintTiles(const Canvas& c, double tile_m, double level) {
  Random random = Random(c.seed).fork(4);
  cv::Mat image = blank(c, 0.45 * level);
  const double px = c.texels_per_m;
  const int joint = std::max(1, cvRound(0.007 * px));
  const auto edge = [&](int i) { return cvRound(i * tile_m * px); };
  for (int j = 0; j * tile_m < c.height_m; ++j)
    for (int i = 0; i * tile_m < c.width_m; ++i)
      cv::rectangle(image, cv::Point(edge(i) + joint, edge(j) + joint),
                    cv::Point(edge(i + 1) - 1, edge(j + 1) - 1),
                    cv::Scalar(level * (1.0 + random.uniform(-0.16, 0.16))), cv::FILLED);
  addFractal(image, c, 0.12, 4, 0.014);
  addStrokes(image, c, 120.0, 0.03, 1.0, 0.1);
  return clampUnit(image);
}

cv::Mat paintWood(const Canvas& c, double level, double plank_m) {
  Random random = Random(c.seed).fork(6);
  const cv::Size size = c.size();
  const double px = c.texels_per_m;
  cv::Mat warp(size, CV_32FC1, cv::Scalar(0.0));
  addNoise(warp, px, 0.45, 0.05, 1.3, c.seed + 1);
  addNoise(warp, px, 0.12, 0.015, 0.35, c.seed + 2);
  cv::Mat image(size, CV_32FC1);
  const int planks = plank_m > 0.0 ? static_cast<int>(c.height_m / plank_m) + 1 : 1;
  std::vector<double> tone(planks), shift(planks);
  for (int i = 0; i < planks; ++i) {
    tone[i] = plank_m > 0.0 ? random.uniform(-0.10, 0.10) : 0.0;
    shift[i] = random.uniform(0.0, 10.0);
  }
  for (int y = 0; y < size.height; ++y) {
    const double v = (y + 0.5) / px;
    const int plank = plank_m > 0.0 ? std::min(static_cast<int>(v / plank_m), planks - 1) : 0;
    for (int x = 0; x < size.width; ++x) {
      const double rings = v / 0.018 + shift[plank] + warp.at<float>(y, x);
      const double saw = rings - std::floor(rings);
      image.at<float>(y, x) = static_cast<float>(level + tone[plank] - 0.11 * saw * saw);
    }
  }
  addNoise(image, px, 0.09, 0.0025, 0.03, c.seed + 3);
  if (plank_m > 0.0) {
    const int joint = std::max(1, cvRound(0.003 * px));
    for (int i = 0; i < planks; ++i) {
      const int y = cvRound(i * plank_m * px), next = cvRound((i + 1) * plank_m * px);
      cv::line(image, cv::Point(0, y), cv::Point(size.width, y), cv::Scalar(0.1), joint);
      for (double x = random.uniform(0.2, 1.6); x < c.width_m; x += random.uniform(0.9, 1.9))
        cv::line(image, cv::Point(cvRound(x * px), y), cv::Point(cvRound(x * px), next),
                 cv::Scalar(0.1), joint);
    }
  }
  const int knots = static_cast<int>(1.5 * c.width_m * c.height_m + random.uniform());
  for (int i = 0; i < knots; ++i) {
    const cv::Point at(random.integer(0, size.width), random.integer(0, size.height));
    for (int ring = 3; ring > 0; --ring)
      cv::ellipse(image, at, cv::Size(cvRound(0.011 * ring * px), cvRound(0.006 * ring * px)), 0, 0,
                  360, cv::Scalar(level * (0.4 + 0.14 * ring)), cv::FILLED, cv::LINE_AA);
  }
  return clampUnit(image);
}

cv::Mat paintFabric(const Canvas& c, double level) {
  cv::Mat image = blank(c, level);
  addNoise(image, c.texels_per_m, 0.02, 0.003, 0.05, c.seed + 1);
  addNoise(image, c.texels_per_m, 0.003, 0.02, 0.05, c.seed + 2);
  addFractal(image, c, 0.3, 3, 0.03);
  return clampUnit(image);
}

cv::Mat paintCarpet(const Canvas& c) {
  Random random = Random(c.seed).fork(8);
  const double px = c.texels_per_m;
  cv::Mat image = blank(c, 0.3);
  const auto frame = [&](double inset, double level, int thickness) {
    cv::rectangle(image, cv::Point(cvRound(inset * px), cvRound(inset * px)),
                  cv::Point(cvRound((c.width_m - inset) * px), cvRound((c.height_m - inset) * px)),
                  cv::Scalar(level), thickness);
  };
  frame(0.04, 0.62, cv::FILLED);
  frame(0.07, 0.22, cv::FILLED);
  frame(0.20, 0.66, cv::FILLED);
  frame(0.22, 0.36, cv::FILLED);
  // A border of lozenges, no two alike.
  const auto lozenge = [&](double x, double y, double size, double level) {
    const double aspect = random.uniform(0.7, 1.3);
    const std::vector<cv::Point> points = {{cvRound((x - size) * px), cvRound(y * px)},
                                           {cvRound(x * px), cvRound((y - size * aspect) * px)},
                                           {cvRound((x + size) * px), cvRound(y * px)},
                                           {cvRound(x * px), cvRound((y + size * aspect) * px)}};
    cv::fillConvexPoly(image, points, cv::Scalar(level), cv::LINE_AA);
  };
  for (double x = 0.135; x < c.width_m - 0.1; x += 0.12)
    for (double y : {0.135, c.height_m - 0.135}) lozenge(x, y, 0.045, random.uniform(0.45, 0.85));
  for (double y = 0.255; y < c.height_m - 0.2; y += 0.12)
    for (double x : {0.135, c.width_m - 0.135}) lozenge(x, y, 0.045, random.uniform(0.45, 0.85));
  const int medallions = static_cast<int>(9.0 * c.width_m * c.height_m);
  for (int i = 0; i < medallions; ++i) {
    const double x = random.uniform(0.33, c.width_m - 0.33),
                 y = random.uniform(0.33, c.height_m - 0.33);
    const double size = random.uniform(0.03, 0.1), level = random.uniform(0.1, 0.8);
    lozenge(x, y, size, level);
    lozenge(x, y, 0.6 * size, random.uniform(0.15, 0.85));
    cv::circle(image, cv::Point(cvRound(x * px), cvRound(y * px)), cvRound(0.2 * size * px),
               cv::Scalar(0.9 - level), cv::FILLED, cv::LINE_AA);
  }
  addNoise(image, px, 0.005, 0.005, 0.07, c.seed + 1);
  addFractal(image, c, 0.2, 2, 0.03);
  return clampUnit(image);
}

cv::Mat paintStone(const Canvas& c, double cell_m) {
  cv::Mat image = paintCells(c, cell_m, 0.12, 0.3, 0.72);
  addFractal(image, c, 0.1, 4, 0.035);
  return clampUnit(image);
}

cv::Mat paintSky(const Canvas& c) {
  cv::Mat image = blank(c, 0.72);
  addFractal(image, c, 0.3 * c.width_m, 4, 0.05);
  return clampUnit(image);
}

cv::Mat paintFoliage(const Canvas& c) {
  Canvas fine = c;
  cv::Mat image = paintCells(fine, 0.09, 0.7, 0.12, 0.55);
  fine.seed = c.seed + 40;
  image = 0.5 * image + 0.6 * paintCells(fine, 0.24, 0.9, 0.1, 0.6);
  addFractal(image, c, 0.6, 5, 0.05);
  return clampUnit(image);
}

cv::Mat paintGrass(const Canvas& c) {
  cv::Mat image = blank(c, 0.3);
  addFractal(image, c, 1.5, 6, 0.045);
  addStrokes(image, c, 900.0, 0.05, 0.9, 0.18, true);
  return clampUnit(image);
}

}  // namespace active_matching_slam
