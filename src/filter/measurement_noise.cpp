#include "active_matching_slam/filter/measurement_noise.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/math/quantile.h"

namespace active_matching_slam {
namespace {

/// Smoothing constant of the exponential window of `kWindow` residuals.
constexpr double kSmoothing = 2.0 / (LandmarkNoise::kWindow + 1);
/// Residuals are clipped to so many of the landmark's own standard deviations, as outliers that
/// passed the gate (Standard: bounded influence, Huber 1981). Derivation: at 4 a Gaussian's
/// variance loses 1e-4 of itself.
constexpr double kClip = 4.0;
/// Rounding error of a search at whole pixels [px^2]. Derivation: variance of a uniform one.
constexpr double kPixelVariance = 1.0 / 12.0;
/// Degrees of freedom that a landmark's scale remembers at most, besides its prior's. Cost: it is
/// known to sqrt(2 / degrees) = 10 % then; more would follow changes later.
constexpr double kLandmarkMemory = 200.0;

}  // namespace

void LandmarkNoise::learn(const Eigen::Vector2d& residual) {
  if (!residual.allFinite()) return;
  const double scale = scale_.scale();
  const Eigen::Vector2d standardised =
      (residual / std::sqrt(scale)).cwiseMax(-kClip).cwiseMin(kClip);
  scale_.learn(scale * standardised.squaredNorm(), 2.0);
  if (scale_.degrees() > kPriorDegrees + kLandmarkMemory)
    scale_.forget((kPriorDegrees + kLandmarkMemory) / scale_.degrees());
  mean_ += kSmoothing * (standardised - mean_);
  mean_variance_ = std::pow(1.0 - kSmoothing, 2) * mean_variance_ + kSmoothing * kSmoothing;
  ++residuals_;
}

double MeasurementNoise::unscaledSigma_px(const FitPrecision& fit) const {
  if (!has_learnt_ || !(fit.sigma_px > 0.0)) return options_.sigma_px;
  return std::sqrt(scale_.scale()) * fit.sigma_px;
}

double MeasurementNoise::sigma_px(const FitPrecision& fit, const LandmarkNoise& landmark) const {
  return std::max(options_.minimum_sigma_px, std::sqrt(landmark.scale()) * unscaledSigma_px(fit));
}

double MeasurementNoise::typicalSigma_px() const {
  return std::max(options_.minimum_sigma_px, unscaledSigma_px({fit_px_}));
}

double MeasurementNoise::inflation(const FitPrecision& fit, const LandmarkNoise& landmark) const {
  if (!has_learnt_) return 1.0;
  // The lower bound of the variance is one of the long-run variance, too.
  const double bound = sigma_px(fit, landmark);
  return std::max(1.0, inflation() * landmark.scale() * std::pow(unscaledSigma_px(fit) / bound, 2));
}

double MeasurementNoise::gateSigma_px(const LandmarkNoise& landmark) const {
  if (!has_learnt_) return options_.sigma_px;
  // Wrong matches would widen the gates that let them in.
  const double bounded_px = std::min(sigma_px({fit_px_}, landmark), options_.sigma_px);
  return std::sqrt(bounded_px * bounded_px + kPixelVariance);
}

double MeasurementNoise::degrees() const { return scale_.degrees(); }

void MeasurementNoise::predict(double interval_s) {
  scale_.forget(std::exp(-interval_s / options_.noise_memory_s));
}

void MeasurementNoise::observeFits(const std::vector<FitPrecision>& fits) {
  std::vector<double> sigmas_px;
  for (const FitPrecision& fit : fits)
    if (fit.sigma_px > 0.0) sigmas_px.push_back(fit.sigma_px);
  if (!sigmas_px.empty()) fit_px_ = medianOf(std::move(sigmas_px));
}

void MeasurementNoise::learn(double scale, double redundancy) {
  if (!(scale > 0.0) || !std::isfinite(scale) || !(redundancy > 0.0) || !(fit_px_ > 0.0)) return;
  // `scale` is in units of the variance expected of a typical match, c_k in those of its fit.
  const double observed = scale * std::pow(typicalSigma_px() / fit_px_, 2);
  scale_.learn(redundancy * observed, redundancy);
  has_learnt_ = true;
}

void MeasurementNoise::learnInflation(const std::vector<double>& inflations) {
  if (inflations.empty()) return;
  double sum = 0.0;
  for (const double inflation : inflations) sum += inflation;
  inflation_.forget(1.0 - kSmoothing);
  inflation_.learn(sum, static_cast<double>(inflations.size()));
}

}  // namespace active_matching_slam
