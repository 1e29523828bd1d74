#include "active_matching_slam/simulation/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "active_matching_slam/math/option_field.h"
#include "active_matching_slam/simulation/random.h"

namespace active_matching_slam {
namespace {

constexpr int kQuantileBits = 12;
constexpr double kMidGrey = 128.0;
constexpr double kConstantFraction = 1.0 / 3.0;

/// Quantile of the standard normal distribution, by bisection.
double normalQuantile(double probability) {
  double low = -8.0, high = 8.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::sqrt(2.0)) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

Sensor::Sensor(int width, int height, double noise, double vignetting) : noise_(noise) {
  checkRange("noise", noise, 0.0, 50.0);
  checkRange("vignetting", vignetting, 0.0, 0.9);
  transmission_.create(height, width, CV_32FC1);
  const double cx = 0.5 * (width - 1), cy = 0.5 * (height - 1);
  const double corner2 = std::max(cx * cx + cy * cy, 1.0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / corner2;
      transmission_.at<float>(y, x) = static_cast<float>(1.0 - vignetting * r2 * (0.6 + 0.4 * r2));
    }
  constexpr int kCount = 1 << kQuantileBits;
  for (int i = 0; i < kCount; ++i)
    normal_.push_back(static_cast<float>(normalQuantile((i + 0.5) / kCount)));
}

double Sensor::noiseAt(double grey) const {
  return noise_ *
         std::sqrt(kConstantFraction + (1.0 - kConstantFraction) * std::max(grey, 0.0) / kMidGrey);
}

void Sensor::expose(const cv::Mat& radiance, double gain, std::uint64_t seed,
                    cv::Mat& image) const {
  image.create(radiance.size(), CV_8UC1);
  std::array<float, 256> sigma;
  for (int i = 0; i < 256; ++i) sigma[i] = static_cast<float>(noiseAt(i));
  Random random = Random(seed).fork(0x53454E53);
  const float scale = static_cast<float>(255.0 * gain);
  std::uint64_t bits = 0;
  int left = 0;
  for (int y = 0; y < image.rows; ++y) {
    const float* light = radiance.ptr<float>(y);
    const float* pass = transmission_.ptr<float>(y);
    std::uint8_t* out = image.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols; ++x) {
      if (left == 0) {
        bits = random.next();
        left = 5;
      }
      const float grey = std::min(scale * light[x] * pass[x], 300.0f);
      const float noise = normal_[bits & ((1 << kQuantileBits) - 1)];
      bits >>= kQuantileBits;
      --left;
      const float value = grey + sigma[std::min(static_cast<int>(grey), 255)] * noise + 0.5f;
      out[x] = static_cast<std::uint8_t>(std::min(std::max(value, 0.0f), 255.0f));
    }
  }
}

}  // namespace active_matching_slam
