#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/textures.h"

namespace active_matching_slam {
namespace {

/// Draws on a canvas in metres.
class Painter {
 public:
  Painter(const Canvas& canvas, double level, std::uint64_t part)
      : px_(canvas.texels_per_m),
        image_(canvas.size(), CV_32FC1, cv::Scalar(level)),
        random_(Random(canvas.seed).fork(part)) {}

  Random& random() { return random_; }
  cv::Mat& image() { return image_; }
  double px() const { return px_; }

  void box(double x, double y, double w, double h, double level) {
    // Half-open, so boxes side by side do not overlap.
    const cv::Rect rect(cvRound(x * px_), cvRound(y * px_),
                        std::max(1, cvRound((x + w) * px_) - cvRound(x * px_)),
                        std::max(1, cvRound((y + h) * px_) - cvRound(y * px_)));
    const cv::Rect inside = rect & cv::Rect(0, 0, image_.cols, image_.rows);
    if (inside.area() > 0) image_(inside).setTo(cv::Scalar(level));
  }
  void disc(double x, double y, double radius, double level) {
    cv::circle(image_, point(x, y), std::max(1, cvRound(radius * px_)), cv::Scalar(level),
               cv::FILLED, cv::LINE_8);
  }
  void line(double x0, double y0, double x1, double y1, double width, double level) {
    cv::line(image_, point(x0, y0), point(x1, y1), cv::Scalar(level),
             std::max(1, cvRound(width * px_)));
  }
  void polygon(const std::vector<cv::Point2d>& corners, double level) {
    std::vector<cv::Point> points;
    for (const cv::Point2d& corner : corners) points.push_back(point(corner.x, corner.y));
    cv::fillPoly(image_, std::vector<std::vector<cv::Point>>{points}, cv::Scalar(level));
  }
  /// A word of random letters, its left end on the base line; returns its width.
  double word(double x, double y, double height, int letters, double level, bool bold = false) {
    std::string text;
    for (int i = 0; i < letters; ++i)
      text += static_cast<char>((random_.uniform() < 0.2 ? 'A' : 'a') + random_.integer(0, 25));
    const int thickness = std::max(1, cvRound(height * px_ * (bold ? 0.17 : 0.1)));
    const int font = bold ? cv::FONT_HERSHEY_DUPLEX : cv::FONT_HERSHEY_SIMPLEX;
    const double scale = height * px_ / 21.0;
    cv::putText(image_, text, point(x, y), font, scale, cv::Scalar(level), thickness);
    int baseline = 0;
    return cv::getTextSize(text, font, scale, thickness, &baseline).width / px_;
  }
  /// Lines of words in a box, from the top; the last line ends early.
  void paragraph(double x, double y, double w, double h, double height, double level) {
    for (double base = y + height; base < y + h; base += 1.9 * height) {
      const bool last = base + 1.9 * height >= y + h;
      const double end = x + w * (last ? random_.uniform(0.3, 0.8) : random_.uniform(0.9, 1.0));
      for (double at = x; at < end - 3.0 * height;)
        at += word(at, base, height, random_.integer(2, 8), level) + 0.7 * height;
    }
  }
  void blob(double x, double y, double radius, double level) {
    std::vector<cv::Point2d> corners;
    const int count = random_.integer(3, 7);
    const double turn = random_.uniform(0.0, 6.28);
    for (int i = 0; i < count; ++i) {
      const double r = radius * random_.uniform(0.6, 1.2), angle = turn + 6.2832 * i / count;
      corners.emplace_back(x + r * std::cos(angle), y + r * std::sin(angle));
    }
    polygon(corners, level);
  }
  void noise(double cell_m, double sigma, std::uint64_t part) {
    addNoise(image_, px_, cell_m, cell_m, sigma, part + 1000 * random_.next() % 1000003);
  }
  cv::Mat finish() {
    cv::min(image_, 1.0, image_);
    cv::max(image_, 0.0, image_);
    return image_;
  }

 private:
  cv::Point point(double x, double y) const { return {cvRound(x * px_), cvRound(y * px_)}; }

  double px_;
  cv::Mat image_;
  Random random_;
};

/// A photograph: hills in front of hills, a sky, a sun.
void landscape(Painter& p, double x, double y, double w, double h) {
  Random& random = p.random();
  const double sky = random.uniform(0.65, 0.9);
  constexpr int kBands = 12;
  for (int i = 0; i < kBands; ++i)
    p.box(x, y + h * i / kBands, w, h / kBands + 0.002, sky - 0.02 * (kBands - i));
  p.disc(x + w * random.uniform(0.2, 0.8), y + h * random.uniform(0.15, 0.3), 0.06 * h, 0.98);
  const int hills = random.integer(3, 5);
  for (int i = 0; i < hills; ++i) {
    const double base = y + h * (0.35 + 0.55 * i / hills);
    std::vector<cv::Point2d> ridge = {{x, y + h}};
    double top = base;
    for (int k = 0; k <= 14; ++k) {
      top = std::clamp(top + random.uniform(-0.06, 0.06) * h, base - 0.15 * h, y + 0.97 * h);
      ridge.emplace_back(x + w * k / 14.0, top);
    }
    ridge.emplace_back(x + w, y + h);
    p.polygon(ridge, 0.55 - 0.45 * (i + 1) / hills + random.uniform(-0.05, 0.05));
  }
}

}  // namespace

cv::Mat paintWallpaper(const Canvas& c) {
  Painter p(c, 0.66, 20);
  constexpr double kStripe = 0.30;
  for (int i = 0; i * kStripe < c.width_m; ++i)
    p.box(i * kStripe, 0.0, 0.5 * kStripe, c.height_m, 0.60);
  // One motif in many sizes and greys: alike, not the same.
  for (int j = 0; j * 0.26 < c.height_m; ++j)
    for (int i = 0; i * 0.30 < c.width_m; ++i) {
      const double x = 0.075 + 0.30 * i + 0.15 * (j % 2), y = 0.13 + 0.26 * j;
      const double size = p.random().uniform(0.018, 0.034), level = p.random().uniform(0.3, 0.5);
      p.polygon({{x, y - 2.0 * size}, {x + size, y}, {x, y + 2.0 * size}, {x - size, y}}, level);
      p.disc(x - 1.3 * size, y + size, 0.45 * size, level);
      p.disc(x + 1.3 * size, y + size, 0.45 * size, level);
      p.line(x, y + 2.0 * size, x, y + 3.2 * size, 0.004, level);
    }
  p.noise(0.005, 0.015, 1);
  p.noise(0.7, 0.03, 2);
  return p.finish();
}

cv::Mat paintPoster(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.1, 21);
  Random& random = p.random();
  const double paper = random.uniform(0.7, 0.95);
  p.box(0.012, 0.012, w - 0.024, h - 0.024, paper);
  const double m = 0.06 * std::min(w, h);
  const int kind = random.integer(0, 2);
  if (kind == 0) {
    landscape(p, m, m, w - 2 * m, 0.72 * h - m);
  } else if (kind == 1) {
    p.box(m, m, w - 2 * m, 0.72 * h - m, random.uniform(0.15, 0.45));
    for (int i = 0; i < 26; ++i)
      p.blob(random.uniform(0.12, 0.88) * w, random.uniform(0.1, 0.66) * h,
             random.uniform(0.03, 0.14) * std::min(w, h), random.uniform(0.05, 0.95));
  } else {
    const int cells = random.integer(4, 6);
    const double side = (w - 2 * m) / cells;
    for (int j = 0; (j + 1) * side < 0.72 * h - m; ++j)
      for (int i = 0; i < cells; ++i) {
        const double x = m + i * side, y = m + j * side;
        p.box(x, y, 0.95 * side, 0.95 * side, random.uniform(0.1, 0.9));
        if (random.uniform() < 0.6)
          p.disc(x + 0.47 * side, y + 0.47 * side, random.uniform(0.15, 0.42) * side,
                 random.uniform(0.05, 0.95));
        else
          p.blob(x + 0.47 * side, y + 0.47 * side, 0.35 * side, random.uniform(0.05, 0.95));
      }
  }
  const double ink = random.uniform(0.03, 0.2);
  p.word(1.2 * m, 0.82 * h, 0.065 * h, static_cast<int>(6.5 * w / h + 2), ink, true);
  p.paragraph(1.2 * m, 0.85 * h, w - 2.4 * m, 0.10 * h, 0.016 * h, ink);
  p.noise(0.004, 0.02, 1);
  return p.finish();
}

cv::Mat paintPage(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.88, 22);
  Random& random = p.random();
  const double m = 0.1 * w;
  p.word(m, m + 0.03 * h, 0.03 * h, random.integer(6, 12), 0.08, true);
  const double figure = random.uniform(0.2, 0.5) * h;
  p.paragraph(m, m + 0.06 * h, w - 2 * m, figure - 0.1 * h, 0.011 * h, 0.15);
  p.box(m, figure + 0.04 * h, 0.5 * w, 0.22 * h, random.uniform(0.2, 0.7));
  for (int i = 0; i < 8; ++i)
    p.blob(m + random.uniform(0.05, 0.45) * w, figure + random.uniform(0.07, 0.23) * h, 0.04 * w,
           random.uniform(0.05, 0.95));
  p.paragraph(m, figure + 0.3 * h, w - 2 * m, h - figure - 0.38 * h, 0.011 * h, 0.15);
  p.noise(0.004, 0.012, 1);
  return p.finish();
}

cv::Mat paintBookSpines(const Canvas& c) {
  const double h = c.height_m;
  Painter p(c, 0.05, 23);
  Random& random = p.random();
  for (double x = 0.0; x < c.width_m;) {
    const double w = random.uniform(0.018, 0.055), tall = h * random.uniform(0.72, 1.0);
    const double level = random.uniform(0.12, 0.85);
    const double ink = level > 0.45 ? random.uniform(0.03, 0.2) : random.uniform(0.65, 0.95);
    p.box(x + 0.001, h - tall, w - 0.002, tall, level);
    p.box(x + 0.001, h - tall, 0.003, tall, 0.7 * level);
    if (random.uniform() < 0.7) p.box(x + 0.001, h - tall * 0.92, w - 0.002, 0.05 * h, ink);
    if (random.uniform() < 0.7)
      p.box(x + 0.001, h - tall * random.uniform(0.2, 0.3), w - 0.002, 0.03 * h, ink);
    if (random.uniform() < 0.4) p.disc(x + 0.5 * w, h - 0.1 * tall, 0.28 * w, ink);
    // A title that runs down the spine: dashes of uneven length.
    for (double y = h - 0.78 * tall; y < h - 0.38 * tall; y += 0.009)
      if (random.uniform() < 0.8)
        p.box(x + w * random.uniform(0.25, 0.4), y, w * random.uniform(0.2, 0.4), 0.005, ink);
    x += w;
  }
  p.noise(0.004, 0.02, 1);
  return p.finish();
}

cv::Mat paintBookCover(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.0, 24);
  Random& random = p.random();
  const double level = random.uniform(0.15, 0.85);
  const double ink = level > 0.5 ? random.uniform(0.03, 0.2) : random.uniform(0.7, 0.95);
  p.box(0, 0, w, h, level);
  p.box(0.06 * w, 0.06 * h, 0.88 * w, 0.88 * h, 0.85 * level);
  p.box(0.12 * w, 0.4 * h, 0.76 * w, 0.36 * h, random.uniform(0.1, 0.9));
  for (int i = 0; i < 9; ++i)
    p.blob(random.uniform(0.2, 0.8) * w, random.uniform(0.45, 0.7) * h,
           random.uniform(0.03, 0.1) * w, random.uniform(0.03, 0.97));
  p.word(0.12 * w, 0.22 * h, 0.1 * std::min(w, h), 6, ink, true);
  p.word(0.12 * w, 0.34 * h, 0.06 * std::min(w, h), 9, ink);
  p.word(0.3 * w, 0.88 * h, 0.05 * std::min(w, h), 8, ink);
  p.noise(0.004, 0.015, 1);
  return p.finish();
}

cv::Mat paintKeyboard(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.12, 25);
  constexpr int kRows = 5, kColumns = 15;
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i) {
      const double kw = 0.94 * w / kColumns, kh = 0.84 * h / kRows;
      const double x = 0.03 * w + i * kw + (j % 2) * 0.25 * kw, y = 0.08 * h + j * kh;
      if (x + kw > w) continue;
      if (j == kRows - 1 && i >= 4 && i <= 8) {
        p.box(x, y, kw, 0.85 * kh, 0.33);
        continue;
      }
      p.box(x, y, 0.86 * kw, 0.85 * kh, 0.33);
      p.word(x + 0.2 * kw, y + 0.55 * kh, 0.4 * kh, 1, 0.85);
    }
  p.noise(0.004, 0.012, 1);
  return p.finish();
}

cv::Mat paintScreen(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.05, 26);
  Random& random = p.random();
  const double m = 0.015;
  p.box(m, m, w - 2 * m, h - 2 * m, 0.3);
  p.box(m, h - 2.2 * m, w - 2 * m, 1.2 * m, 0.6);
  const auto window = [&](double x, double y, double ww, double wh, double paper, double ink) {
    p.box(x, y, ww, wh, paper);
    p.box(x, y, ww, 0.05 * h, 0.5);
    p.word(x + 0.02 * w, y + 0.038 * h, 0.028 * h, 9, 0.95);
    for (double line = y + 0.1 * h; line < y + wh - 0.02 * h; line += 0.036 * h) {
      double at = x + 0.02 * w + 0.03 * w * random.integer(0, 3);
      for (int i = random.integer(1, 4); i > 0 && at < x + 0.75 * ww; --i)
        at += p.word(at, line, 0.02 * h, random.integer(2, 7), ink) + 0.012 * w;
    }
  };
  window(0.06 * w, 0.08 * h, 0.5 * w, 0.78 * h, 0.08, 0.8);
  window(0.48 * w, 0.2 * h, 0.46 * w, 0.6 * h, 0.92, 0.1);
  return p.finish();
}

cv::Mat paintCalendar(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.9, 27);
  landscape(p, 0.04 * w, 0.03 * h, 0.92 * w, 0.42 * h);
  p.word(0.08 * w, 0.53 * h, 0.045 * h, 7, 0.08, true);
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 7; ++i) {
      const double x = (0.05 + 0.13 * i) * w, y = (0.57 + 0.082 * j) * h;
      p.box(x, y, 0.122 * w, 0.075 * h, i >= 5 ? 0.6 : 0.8);
      const int day = 7 * j + i + 1;
      cv::putText(p.image(), std::to_string(day),
                  cv::Point(cvRound((x + 0.02 * w) * p.px()), cvRound((y + 0.055 * h) * p.px())),
                  cv::FONT_HERSHEY_SIMPLEX, 0.04 * h * p.px() / 21.0, cv::Scalar(0.08),
                  std::max(1, cvRound(0.005 * h * p.px())));
    }
  p.noise(0.004, 0.012, 1);
  return p.finish();
}

cv::Mat paintCorkBoard(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.42, 28);
  Random& random = p.random();
  p.noise(0.006, 0.07, 1);
  p.noise(0.015, 0.05, 2);
  for (double t : {0.0, h - 0.025}) p.box(0, t, w, 0.025, 0.25);
  for (double t : {0.0, w - 0.025}) p.box(t, 0, 0.025, h, 0.25);
  const int notes = static_cast<int>(16.0 * w * h) + 3;
  for (int i = 0; i < notes; ++i) {
    const double nw = random.uniform(0.09, 0.2), nh = random.uniform(0.09, 0.24);
    const double x = random.uniform(0.04, w - nw - 0.04), y = random.uniform(0.04, h - nh - 0.04);
    const double paper = random.uniform(0.6, 0.95);
    p.box(x + 0.006, y + 0.006, nw, nh, 0.25);
    p.box(x, y, nw, nh, paper);
    if (random.uniform() < 0.35)
      landscape(p, x + 0.008, y + 0.008, nw - 0.016, nh - 0.016);
    else
      p.paragraph(x + 0.012, y + 0.02, nw - 0.024, nh - 0.03, random.uniform(0.006, 0.012), 0.12);
    p.disc(x + 0.5 * nw, y + 0.01, 0.006, 0.05);
  }
  return p.finish();
}

cv::Mat paintPackage(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.48, 29);
  Random& random = p.random();
  p.noise(0.004, 0.02, 1);
  p.noise(0.1, 0.03, 2);
  p.box(0.44 * w, 0, 0.12 * w, h, 0.62);
  p.box(0.08 * w, 0.2 * h, 0.3 * w, 0.34 * h, 0.9);
  p.paragraph(0.1 * w, 0.24 * h, 0.26 * w, 0.16 * h, 0.035 * h, 0.1);
  for (double x = 0.1; x < 0.36; x += random.uniform(0.008, 0.022))
    p.box(x * w, 0.43 * h, random.uniform(0.003, 0.01) * w, 0.09 * h, 0.05);
  p.word(0.6 * w, 0.5 * h, 0.13 * std::min(w, h), 5, 0.12, true);
  p.blob(0.75 * w, 0.76 * h, 0.09 * std::min(w, h), 0.1);
  p.blob(0.62 * w, 0.78 * h, 0.07 * std::min(w, h), 0.1);
  return p.finish();
}

cv::Mat paintWindow(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.75, 30);
  landscape(p, 0.06, 0.06, w - 0.12, h - 0.12);
  p.noise(0.03, 0.06, 1);
  for (double x : {0.0, 0.5 * w - 0.03, w - 0.06}) {
    p.box(x, 0, 0.06, h, 0.8);
    p.box(x + 0.05, 0, 0.01, h, 0.35);
  }
  for (double y : {0.0, 0.38 * h, h - 0.06}) p.box(0, y, w, 0.06, 0.78);
  p.box(0.5 * w - 0.012, 0.55 * h, 0.024, 0.1, 0.2);
  return p.finish();
}

cv::Mat paintLandscape(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.72, 31);
  p.noise(0.15 * w, 0.03, 1);
  // Hills in the lower half, the nearer the darker; trees on the nearest.
  for (int i = 0; i < 4; ++i) {
    const double base = h * (0.55 + 0.08 * i), level = 0.58 - 0.1 * i;
    std::vector<cv::Point2d> ridge = {{0.0, h}};
    double top = base;
    for (int k = 0; k <= 40; ++k) {
      top =
          std::clamp(top + p.random().uniform(-0.035, 0.035) * h, base - 0.12 * h, base + 0.05 * h);
      ridge.emplace_back(w * k / 40.0, top);
    }
    ridge.emplace_back(w, h);
    p.polygon(ridge, level);
    for (int k = 0; k < 60 * i; ++k) {
      const double x = p.random().uniform(0.0, w),
                   y = h * p.random().uniform(0.52 + 0.08 * i, 0.95);
      p.blob(x, y, h * p.random().uniform(0.004, 0.016), level * p.random().uniform(0.5, 1.2));
    }
  }
  p.noise(0.006 * w, 0.02, 2);
  return p.finish();
}

cv::Mat paintFacade(const Canvas& c) {
  Painter p(c, 0.5, 32);
  Random& random = p.random();
  p.image() = paintBricks(c);
  constexpr double kBay = 2.4, kFloor = 3.0;
  for (double y = 0.8; y + 1.5 < c.height_m; y += kFloor)
    for (double x = 0.7; x + 1.1 < c.width_m; x += kBay) {
      p.box(x - 0.08, y - 0.08, 1.16, 1.66, 0.72);
      p.box(x, y, 1.0, 1.5, random.uniform(0.08, 0.2));
      for (double t : {0.0, 0.48, 0.96}) p.box(x + t, y, 0.04, 1.5, 0.75);
      p.box(x, y + 0.55, 1.0, 0.04, 0.75);
      if (random.uniform() < 0.5) p.box(x + 0.04, y, 0.44, random.uniform(0.3, 1.2), 0.6);
      p.box(x - 0.14, y + 1.52, 1.28, 0.09, 0.66);
    }
  return p.finish();
}

cv::Mat paintDoor(const Canvas& c) {
  const double w = c.width_m, h = c.height_m;
  Painter p(c, 0.5, 33);
  p.image() = paintWood(c, 0.5);
  for (double y : {0.06, 0.56})
    for (double x : {0.1, 0.54}) {
      const double ph = 0.36 * h;
      p.box(x * w, y * h, 0.36 * w, ph, 0.24);
      p.box(x * w + 0.012, y * h + 0.012, 0.36 * w - 0.024, ph - 0.024, 0.46);
      p.box(x * w + 0.05, y * h + 0.05, 0.36 * w - 0.1, ph - 0.1, 0.53);
    }
  p.disc(0.93 * w, 0.51 * h, 0.03, 0.9);
  p.disc(0.93 * w, 0.57 * h, 0.01, 0.05);
  p.noise(0.01, 0.02, 1);
  return p.finish();
}

cv::Mat paintCheckerboard(const Canvas& c, double square_m) {
  Painter p(c, 0.85, 34);
  for (int j = 0; j * square_m < c.height_m; ++j)
    for (int i = j % 2; i * square_m < c.width_m; i += 2)
      p.box(i * square_m, j * square_m, square_m, square_m, 0.08);
  return p.finish();
}

}  // namespace active_matching_slam
