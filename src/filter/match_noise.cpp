#include "active_matching_slam/filter/match_noise.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "active_matching_slam/filter/quantile.h"

namespace active_matching_slam {
namespace {

constexpr std::size_t kLeastMatches = 8;
constexpr double kWeight = 0.02;  ///< of one update in the average
/// What wanders with the view, each corner in its own way, is taken for the map's: it shows little
/// in what is left, and does not average out. As white noise it weighs so much more than what
/// shows. (By NEES over rendered runs.)
constexpr double kUnseen = 2.7;
constexpr double kSigmaByMedian = 1.4826;  ///< of a Gaussian's absolute values

constexpr double kMemory = 0.99;      ///< of a feature's noise, a match
constexpr double kLikeOthers = 20.0;  ///< matches for which a feature is taken to be like others
constexpr double kMostSigmas = 10.0;  ///< that one match says

}  // namespace

double MatchNoise::learn(const FilterOptions& options,
                         const std::vector<Eigen::Vector2d>& residuals_px) {
  std::vector<double> sizes_px;
  for (const Eigen::Vector2d& residual : residuals_px) {
    if (!residual.allFinite()) continue;
    sizes_px.push_back(std::abs(residual.x()));
    sizes_px.push_back(std::abs(residual.y()));
  }
  if (sizes_px.size() < 2 * kLeastMatches) return 0.0;
  const double shown_px = kSigmaByMedian * medianOf(std::move(sizes_px));
  const double before_px2 = variance_px2_.value_or(options.sigma_px * options.sigma_px);
  variance_px2_ = before_px2 + kWeight * (kUnseen * kUnseen * shown_px * shown_px - before_px2);
  return shown_px;
}

double MatchNoise::sigma_px(const FilterOptions& options) const {
  if (!variance_px2_) return options.sigma_px;
  return std::min(options.sigma_px, std::max(options.minimum_sigma_px, std::sqrt(*variance_px2_)));
}

double MatchNoise::sigma_px(const FilterOptions& options, const FeatureNoise& feature) const {
  return std::max(std::min(options.sigma_px, options.minimum_sigma_px),
                  feature.factor() * sigma_px(options));
}

void FeatureNoise::learn(const Eigen::Vector2d& residual_px, double shown_px) {
  const double squared = 0.5 * (residual_px / shown_px).squaredNorm();
  if (!std::isfinite(squared)) return;
  sum_ = kMemory * sum_ + std::min(squared, kMostSigmas * kMostSigmas);
  count_ = kMemory * count_ + 1.0;
}

double FeatureNoise::factor() const {
  return std::sqrt((kLikeOthers + sum_) / (kLikeOthers + count_));
}

}  // namespace active_matching_slam
