#include "active_matching_slam/filter/match_noise.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "active_matching_slam/math/quantile.h"

namespace active_matching_slam {
namespace {

constexpr std::size_t kLeastMatches = 8;
/// Of one update in the average, once there are many.
constexpr double kLeastWeightShown = 0.6, kLeastWeightSeen = 0.05;
/// The noise that matches are taken to have, but for their tails, in what updates show. (By NEES
/// over rendered runs, as are the next.)
constexpr double kShareOfShown = 0.77;
/// Of the variance of matches, the share that lasts: the same patch is off in the same way, again.
constexpr double kLastingShare = 0.5;
/// Power of what features show of their lasting errors' variance by which these are larger, and the
/// least and most that it makes. (By what residuals tell of the errors of the same feature later.)
constexpr double kLastingByShown = 0.75, kLeastLasting = 0.25, kMostLasting = 10.0;
constexpr double kLastingWeight = 0.05;  ///< of one image in what most show
/// Motion of the image after which what lasts is another, and the most images that are taken to
/// have it in common.
constexpr double kFreshPx = 5.5, kMostSameImages = 15.0;
/// Power of what images tell by which corners wander more. (By the same.)
constexpr double kWanderByMisfit = 2.0;
constexpr double kLeastWander = 0.7, kMostWander = 10.0;  ///< of a corner, in that of most
constexpr double kSharpest = 0.2, kMostBlurred = 5.0;     ///< image, in what most tell
/// Power of what an image tells by which its matches are noisier: blur leaves little to match by.
/// (By what updates then show.)
constexpr double kNoiseByMisfit = 1.5;
constexpr double kSigmaByMedian = 1.4826;  ///< of a Gaussian's absolute values

constexpr double kSightWeight = 0.1;  ///< of one match in a feature's average, once there are many
constexpr double kMemory = 0.99;      ///< of a feature's noise, a match
constexpr double kLikeOthers = 20.0;  ///< matches for which a feature is taken to be like others
constexpr double kMostSigmas = 10.0;  ///< that one match says
constexpr double kRecentWeight = 0.125;     ///< of one match in the average of some in a row
constexpr double kEnoughForLasting = 30.0;  ///< matches

/// An average over time that begins with its first value; `before` 0: there is none.
double averaged(double before, double now, double weight) {
  return before > 0.0 ? before + weight * (now - before) : now;
}

}  // namespace

double MatchNoise::learn(const std::vector<Eigen::Vector2d>& residuals_px) {
  std::vector<double> sizes_px;
  for (const Eigen::Vector2d& residual : residuals_px) {
    if (!residual.allFinite()) continue;
    sizes_px.push_back(std::abs(residual.x()));
    sizes_px.push_back(std::abs(residual.y()));
  }
  if (sizes_px.size() < 2 * kLeastMatches) return 0.0;
  const double shown_px = kSigmaByMedian * medianOf(std::move(sizes_px));
  const double weight = std::max(kLeastWeightShown, 1.0 / ++updates_);
  shown_px2_ += weight * (std::pow(shown_px / noiseOfImage(), 2) - shown_px2_);
  return shown_px;
}

void MatchNoise::seeMotion(std::vector<double> motions_px) {
  const double motion_px = motions_px.size() < kLeastMatches
                               ? std::numeric_limits<double>::infinity()
                               : medianOf(std::move(motions_px));
  same_images_ = std::clamp(kFreshPx / motion_px, 1.0, kMostSameImages);
}

void MatchNoise::see(std::vector<double> sigmas_px) {
  of_image_ = 1.0;
  if (sigmas_px.size() < kLeastMatches) return;
  const double now_px = medianOf(std::move(sigmas_px));
  seen_px_ = averaged(seen_px_, now_px, kLeastWeightSeen);
  if (seen_px_ > 0.0) of_image_ = std::clamp(now_px / seen_px_, kSharpest, kMostBlurred);
}

void MatchNoise::learnLasting(std::vector<double> lasting) {
  if (lasting.size() < kLeastMatches) return;
  lasting_ = averaged(lasting_, medianOf(std::move(lasting)), kLastingWeight);
}

double MatchNoise::lastingLikeMost(const FeatureNoise& feature) const {
  if (!(lasting_ > 0.0)) return 1.0;
  return std::clamp(std::pow(feature.lastingLikeMost(lasting_), kLastingByShown), kLeastLasting,
                    kMostLasting);
}

double MatchNoise::repetitions(const FeatureNoise& feature) const {
  const double lasting = kLastingShare * lastingLikeMost(feature);
  return 1.0 + lasting / (1.0 - kLastingShare + lasting) * (same_images_ - 1.0);
}

double MatchNoise::likeMost(const FeatureNoise& feature) const {
  if (!(feature.seen_px() > 0.0) || !(seen_px_ > 0.0)) return 1.0;
  return std::pow(feature.seen_px() / seen_px_, kWanderByMisfit);
}

double MatchNoise::inThatOfMost(const FeatureNoise& feature) const {
  return feature.factor() * likeMost(feature);
}

double MatchNoise::wanderLikeMost(const FeatureNoise& feature) const {
  return std::clamp(inThatOfMost(feature) * std::sqrt(lastingLikeMost(feature)), kLeastWander,
                    kMostWander);
}

double MatchNoise::noiseOfImage() const { return std::pow(of_image_, kNoiseByMisfit); }

double MatchNoise::sigma_px(const FilterOptions& options) const {
  if (updates_ == 0) return options.sigma_px;
  const double sigma_px = kShareOfShown * noiseOfImage() * std::sqrt(shown_px2_);
  return std::min(options.sigma_px, std::max(options.minimum_sigma_px, sigma_px));
}

double MatchNoise::sigma_px(const FilterOptions& options, const FeatureNoise& feature) const {
  const double in_that_of_most = 1.0 + kLastingShare * (lastingLikeMost(feature) - 1.0);
  return std::max(std::min(options.sigma_px, options.minimum_sigma_px),
                  std::sqrt(in_that_of_most) * inThatOfMost(feature) * sigma_px(options));
}

void FeatureNoise::see(double sigma_px) {
  if (!(sigma_px > 0.0)) return;
  const double weight = std::max(kSightWeight, 1.0 / ++seen_);
  seen_px2_ += weight * (sigma_px * sigma_px - seen_px2_);
}

double FeatureNoise::seen_px() const { return std::sqrt(seen_px2_); }

void FeatureNoise::learn(const Eigen::Vector2d& residual_px, double shown_px) {
  const double squared = 0.5 * (residual_px / shown_px).squaredNorm();
  if (!std::isfinite(squared)) return;
  sum_ = kMemory * sum_ + std::min(squared, kMostSigmas * kMostSigmas);
  count_ = kMemory * count_ + 1.0;
  learnLasting(residual_px / shown_px);
}

void FeatureNoise::learnLasting(Eigen::Vector2d in_shown) {
  if (in_shown.norm() > kMostSigmas) in_shown *= kMostSigmas / in_shown.norm();
  recent_ += kRecentWeight * (in_shown - recent_);
  recent_variance_ =
      std::pow(1.0 - kRecentWeight, 2) * recent_variance_ + kRecentWeight * kRecentWeight;
  lasting_sum_ = kMemory * lasting_sum_ + 0.5 * recent_.squaredNorm() / recent_variance_;
}

std::optional<double> FeatureNoise::lasting() const {
  if (!(count_ > kEnoughForLasting)) return std::nullopt;
  return lasting_sum_ / count_;
}

double FeatureNoise::lastingLikeMost(double of_most) const {
  return (kLikeOthers + lasting_sum_ / of_most) / (kLikeOthers + count_);
}

double FeatureNoise::factor() const {
  return std::sqrt((kLikeOthers + sum_) / (kLikeOthers + count_));
}

}  // namespace active_matching_slam
