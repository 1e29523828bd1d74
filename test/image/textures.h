#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

/// A grey texture known everywhere exactly: a sum of waves of random direction and phase.
class WaveTexture {
 public:
  /// Wavelengths between `shortest` and four times that, in the units of value()'s arguments.
  WaveTexture(unsigned seed, double shortest, double amplitude = 40.0, int waves = 24) {
    std::mt19937 generator(seed);
    const auto uniform = [&] { return generator() / 4294967296.0; };
    for (int i = 0; i < waves; ++i) {
      const double number = 2.0 * M_PI / (shortest * std::pow(4.0, uniform()));
      const double direction = 2.0 * M_PI * uniform();
      waves_.push_back({number * std::cos(direction), number * std::sin(direction),
                        2.0 * M_PI * uniform(), amplitude * std::sqrt(2.0 / waves)});
    }
  }

  /// Mean 128; standard deviation `amplitude`.
  double value(double x, double y) const {
    double sum = 128.0;
    for (const Wave& w : waves_) sum += w.amplitude * std::cos(w.x * x + w.y * y + w.phase);
    return sum;
  }

  /// Image whose pixel (u, v) shows the texture at (u + shift_x, v + shift_y).
  cv::Mat render(int width, int height, double shift_x = 0.0, double shift_y = 0.0) const {
    cv::Mat image(height, width, CV_8UC1);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u)
        image.at<std::uint8_t>(v, u) = toGrey(value(u + shift_x, v + shift_y));
    return image;
  }

  static std::uint8_t toGrey(double value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  }

 private:
  struct Wave {
    double x, y, phase, amplitude;
  };
  std::vector<Wave> waves_;
};

/// Independent uniform grey levels from `low` to `high`.
inline cv::Mat randomImage(int width, int height, unsigned seed, int low = 0, int high = 255) {
  std::mt19937 generator(seed);
  cv::Mat image(height, width, CV_8UC1);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      image.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(low + generator() % (high - low + 1u));
  return image;
}

/// The `size` x `size` pixels around (u, v).
inline Template cutTemplate(const cv::Mat& image, int u, int v, int size = 11) {
  return *makeTemplate(image(cv::Rect(u - size / 2, v - size / 2, size, size)));
}

/// Adds Gaussian noise of standard deviation `sigma` grey levels.
inline void addNoise(cv::Mat* image, double sigma, unsigned seed) {
  std::mt19937 generator(seed);
  for (int v = 0; v < image->rows; ++v)
    for (int u = 0; u < image->cols; ++u) {
      // Irwin-Hall: twelve uniform numbers, the same with every standard library.
      double sum = -6.0;
      for (int i = 0; i < 12; ++i) sum += generator() / 4294967296.0;
      std::uint8_t& pixel = image->at<std::uint8_t>(v, u);
      pixel = WaveTexture::toGrey(pixel + sigma * sum);
    }
}

}  // namespace active_matching_slam
