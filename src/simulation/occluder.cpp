#include "active_matching_slam/simulation/occluder.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "active_matching_slam/simulation/random.h"

namespace active_matching_slam {
namespace {

using Eigen::Vector2d;

constexpr double kPeriodS = 6.0;    ///< one crossing in each period
constexpr double kCrossingS = 1.4;  ///< duration of a crossing

/// A rounded stroke from `from` to `to`. Lengths in image widths.
struct Capsule {
  Vector2d from, to;
  double radius;
};

std::vector<Capsule> hand(const Vector2d& palm, double turn) {
  const auto at = [&](double x, double y) {
    return Vector2d(palm + Vector2d(std::cos(turn) * x - std::sin(turn) * y,
                                    std::sin(turn) * x + std::cos(turn) * y));
  };
  return {{at(-0.03, 0.0), at(0.04, 0.0), 0.085},  // palm
          {at(0.0, 0.05), at(0.05, 0.75), 0.062},  // wrist and arm
          {at(-0.06, -0.04), at(-0.11, -0.20), 0.024}, {at(-0.015, -0.06), at(-0.03, -0.25), 0.026},
          {at(0.035, -0.06), at(0.045, -0.24), 0.025}, {at(0.085, -0.04), at(0.12, -0.18), 0.021},
          {at(-0.09, 0.04), at(-0.2, -0.06), 0.028}};
}

/// Signed distance to the union of the strokes; negative inside.
double distanceTo(const std::vector<Capsule>& strokes, const Vector2d& p) {
  double least = 1e9;
  for (const Capsule& c : strokes) {
    const Vector2d axis = c.to - c.from;
    const double along = std::clamp((p - c.from).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - c.from - along * axis).norm() - c.radius);
  }
  return least;
}

}  // namespace

bool Occluder::cover(double t_s, double exposure_s, cv::Mat& radiance) const {
  const double cycle = std::floor(t_s / kPeriodS);
  Random random = Random(seed_).fork(static_cast<std::uint64_t>(cycle) + 0x4F43);
  const double begin = cycle * kPeriodS + random.uniform(0.35, 0.7) * kPeriodS;
  const double phase = (t_s - begin) / kCrossingS;
  if (phase < 0.0 || phase > 1.0) return false;
  const double aspect = static_cast<double>(radiance.rows) / radiance.cols;
  const double side = random.sign();
  constexpr double kTravel = 1.7;  // [image widths]
  const Vector2d palm(
      0.5 + side * kTravel * (phase - 0.5),
      aspect * (0.55 + random.uniform(-0.1, 0.1)) - 0.1 * std::sin(3.14159 * phase));
  const std::vector<Capsule> strokes = hand(palm, 0.35 * side * (1.0 - 2.0 * phase));
  const double edge = 1.5 / radiance.cols + 0.5 * exposure_s * kTravel / kCrossingS;
  for (int y = 0; y < radiance.rows; ++y) {
    float* row = radiance.ptr<float>(y);
    for (int x = 0; x < radiance.cols; ++x) {
      const Vector2d p((x + 0.5) / radiance.cols, (y + 0.5) / radiance.cols);
      const double distance = distanceTo(strokes, p);
      if (distance > edge) continue;
      const double opaque = std::clamp(0.5 - 0.5 * distance / edge, 0.0, 1.0);
      const double depth = std::min(-distance / 0.03, 1.0);
      const double skin = 0.33 + 0.13 * std::sqrt(std::max(depth, 0.0)) +
                          0.006 * std::sin(160.0 * (p - palm).norm()) - 0.06 * (p.y() - palm.y());
      row[x] = static_cast<float>((1.0 - opaque) * row[x] + opaque * skin);
    }
  }
  return true;
}

}  // namespace active_matching_slam
