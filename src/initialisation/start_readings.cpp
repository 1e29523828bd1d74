#include "start_readings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "active_matching_slam/math/quantile.h"
#include "start_directions.h"

namespace active_matching_slam {
namespace {

/// By so much wider than that of a new feature is the prior of depths while readings are told
/// apart: in a scene that goes from near to far it would rather bend the motion than let depths
/// differ.
constexpr double kDepthFreedom = 10.0;
constexpr std::size_t kFewImages = 10;     ///< that tell the readings of the images apart
constexpr double kHopelessCostGap = 12.0;  ///< by the noise assumed
/// Relative fall of the cost that is worth a step more, by that noise and by the images' own.
constexpr double kGainToCompare = 1e-2, kGainToTell = 1e-3;
constexpr double kLeastCostGap = 6.0;      ///< by the images' own: to the next reading, odds of e^3
constexpr double kMostCostPerPoint = 4.0;  ///< of 2 expected: beyond, things move or matches lie
constexpr double kLeastNoise_px = 0.04;    ///< by which matches are told from wrong ones
/// Of the assumed variance: when readings are compared, images are credited with no less.
constexpr double kLeastNoiseShare = 0.05;
constexpr double kMostNoise = 3.0;       ///< of a feature, in the median, that counts
constexpr double kSameDirection = 0.95;  ///< cosine between two readings' moves that are one

bool isSameReading(const Bundle& a, const Bundle& b) {
  const Eigen::Vector3d& x = a.cameras.back().position_world;
  const Eigen::Vector3d& y = b.cameras.back().position_world;
  return x.dot(y) > kSameDirection * x.norm() * y.norm();
}

/// Every how many images one is taken, counted from the last, so that few remain.
std::size_t stride(const Bundle& bundle) {
  return (bundle.cameras.size() + kFewImages - 1) / kFewImages;
}

/// The first image, the last, and some between.
Bundle someImages(const Bundle& bundle) {
  Bundle some;
  some.features = bundle.features;
  some.calibration = bundle.calibration;
  const std::size_t last = bundle.cameras.size() - 1;
  for (std::size_t k = 0; k <= last; ++k) {
    if (k != 0 && (last - k) % stride(bundle) != 0) continue;
    some.cameras.push_back(bundle.cameras[k]);
    some.observations.push_back(bundle.observations[k]);
  }
  return some;
}

/// All images of `bundle`: features as in `some`, its cameras where it has them, and the others
/// moved as the next one that it has.
Bundle allImages(const Bundle& some, const Bundle& bundle) {
  Bundle all = bundle;
  all.features = some.features;
  all.calibration = some.calibration;
  const std::size_t last = bundle.cameras.size() - 1;
  std::size_t next = 1;
  for (std::size_t k = 1; k <= last; ++k) {
    const std::size_t there = k + (last - k) % stride(bundle);  // the next that `some` has
    const Eigen::Isometry3d correction =
        some.cameras[next].poseWorldCamera() * bundle.cameras[there].poseWorldCamera().inverse();
    all.cameras[k].setPoseWorldCamera(correction * bundle.cameras[k].poseWorldCamera());
    if (k == there) ++next;
  }
  return all;
}

/// Image points in all images.
double countPoints(const Bundle& bundle) {
  std::size_t points = 0;
  for (const auto& observations : bundle.observations) points += observations.size();
  return static_cast<double>(points);
}

}  // namespace

bool costsTooMuch(double cost, const Bundle& bundle) {
  return cost > kMostCostPerPoint * countPoints(bundle);
}

double noiseOf(const CameraModel& model, const Bundle& bundle) {
  std::vector<double> errors_px = featureErrors(model, bundle);
  errors_px.erase(std::remove(errors_px.begin(), errors_px.end(), 0.0), errors_px.end());
  const double equations = 2.0 * countPoints(bundle);
  const double unknowns = 3.0 * static_cast<double>(errors_px.size()) +
                          6.0 * static_cast<double>(bundle.cameras.size() - 1);
  const double freedom = std::max(equations - unknowns, 0.1 * equations);
  const double most_px = kMostNoise * medianOf(errors_px);
  double squares = 0.0;
  for (const double error_px : errors_px) squares += std::pow(std::min(error_px, most_px), 2);
  const double features = std::max(static_cast<double>(errors_px.size()), 1.0);
  return std::sqrt(squares / features * equations / freedom);
}

std::optional<ChosenReading> bestReading(const CameraModel& model, const BundleOptions& options,
                                         const Bundle& believed, bool is_first) {
  std::vector<Bundle> readings(1, someImages(believed));
  Bundle turned;
  if (is_first) {
    turned = readings[0];
    flatten(model, options.inverse_depth, &turned);
    readings.push_back(turned);
  }
  const std::size_t upright = readings.size();
  std::vector<double> costs;
  BundleOptions telling = options;
  telling.sigma_inverse_depth *= kDepthFreedom;
  telling.least_gain = kGainToCompare;
  for (std::size_t i = 0; i < 2 * upright; ++i) {
    if (i >= upright) {
      if (i == 3 && isSameReading(readings[0], readings[1])) break;
      readings.push_back(readings[i - upright]);
      reverseDepths(model, &readings.back());
    }
    costs.push_back(adjustBundle(model, telling, &readings[i]));
    telling.hopeless_cost = std::min(telling.hopeless_cost, costs.back() + kHopelessCostGap);
  }
  auto best = std::min_element(costs.begin(), costs.end()) - costs.begin();
  if (costsTooMuch(costs[best], readings[best])) return std::nullopt;
  // Images are often much better than assumed. By the noise assumed, one match that is wrong would
  // then weigh as much as all that are right; by their own, it does not.
  telling.sigma_px = std::clamp(noiseOf(model, readings[best]), kLeastNoise_px, options.sigma_px);
  telling.outlier_px *= telling.sigma_px / options.sigma_px;
  const double credited = kLeastNoiseShare * std::pow(options.sigma_px / telling.sigma_px, 2);
  const double least_gap = kLeastCostGap * std::max(1.0, credited);
  telling.hopeless_cost = std::numeric_limits<double>::infinity();
  telling.least_gain = kGainToTell;
  if (is_first) {
    for (Bundle& reading : readingsByDirection(model, telling, turned))
      readings.push_back(std::move(reading));
  }
  costs.clear();
  for (Bundle& reading : readings) {
    costs.push_back(adjustBundle(model, telling, &reading));
    telling.hopeless_cost = std::min(telling.hopeless_cost, costs.back() + least_gap);
  }
  best = std::min_element(costs.begin(), costs.end()) - costs.begin();
  double lead = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < costs.size(); ++i)
    if (!isSameReading(readings[i], readings[best]))
      lead = std::min(lead, (costs[i] - costs[best]) / least_gap);
  if (lead < 1.0) return std::nullopt;
  return ChosenReading{allImages(readings[best], believed), lead};
}

}  // namespace active_matching_slam
