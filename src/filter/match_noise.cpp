#include "active_matching_slam/filter/match_noise.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "active_matching_slam/filter/quantile.h"

namespace active_matching_slam {
namespace {

constexpr std::size_t kLeastResiduals = 16;
constexpr double kWeight = 0.02;  ///< of one update in the average
/// What wanders with the view, each corner in its own way, is taken for the map's: it shows little
/// in what is left, and does not average out. As white noise it weighs so much more than what
/// shows. (By NEES over rendered runs.)
constexpr double kUnseen = 4.5;
constexpr double kSigmaByMedian = 1.4826;  ///< of a Gaussian's absolute values

}  // namespace

void MatchNoise::learn(const FilterOptions& options, std::vector<double> residuals_px) {
  residuals_px.erase(std::remove_if(residuals_px.begin(), residuals_px.end(),
                                    [](double residual) { return !std::isfinite(residual); }),
                     residuals_px.end());
  if (residuals_px.size() < kLeastResiduals) return;
  for (double& residual : residuals_px) residual = std::abs(residual);
  const double shown_px = kUnseen * kSigmaByMedian * medianOf(std::move(residuals_px));
  const double before_px2 = variance_px2_.value_or(options.sigma_px * options.sigma_px);
  variance_px2_ = before_px2 + kWeight * (shown_px * shown_px - before_px2);
}

double MatchNoise::sigma_px(const FilterOptions& options) const {
  if (!variance_px2_) return options.sigma_px;
  return std::min(options.sigma_px, std::max(options.minimum_sigma_px, std::sqrt(*variance_px2_)));
}

}  // namespace active_matching_slam
