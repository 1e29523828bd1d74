#include "active_matching_slam/filter/motion_noise.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

/// Degrees of freedom of an image in which all three impulses are resolved.
constexpr double kImageDegrees = 3.0;  // Derivation: three axes
/// Images that the memory spans at least. Derivation: the fewest whose six degrees leave the
/// predictive t distribution a kurtosis.
constexpr double kFewestImages = 2.0;

/// Correlation time of accelerations [s], which a constant velocity takes for white. Standard:
/// first-order Gauss-Markov (Singer 1970). Derivation: a hand moves at up to some 1.6 Hz = 1 / (2
/// pi 0.1 s).
constexpr double kCorrelationS = 0.1;
/// Prior of the probability of a jerk, as sure as so many images. Standard: contamination of 5 % in
/// robust statistics (Huber 1964).
constexpr double kPriorImages = 20.0, kPriorJerks = 1.0;

/// Long-run variance of accelerations over their variance, sampled at an interval.
double longRunFactor(double interval_s) {
  return interval_s > 0.0 ? 1.0 / std::tanh(0.5 * interval_s / kCorrelationS) : 1.0;
}

/// Standard deviation of the predictive distribution, for a variance `factor` times as large.
double predictiveSigma(const VarianceScale& scale, double factor, double widest) {
  if (!(scale.degrees() > 2.0)) return widest;
  const double variance = factor * scale.scale() * scale.degrees() / (scale.degrees() - 2.0);
  return std::min(widest, std::sqrt(variance));
}

/// Forgets, as much as comes: where images tell nothing, what was learnt before stays.
void learnImpulse(const ImpulseEstimate& estimate, double allowed, double most_degrees,
                  VarianceScale* scale) {
  if (!(estimate.degrees > 0.0) || !std::isfinite(estimate.squares)) return;
  scale->learn(allowed * allowed * estimate.squares, estimate.degrees);
  if (scale->degrees() > most_degrees) scale->forget(most_degrees / scale->degrees());
}

}  // namespace

void MotionNoise::setOptions(const FilterOptions& options) {
  widest_ = {options.sigma_acceleration_mps2, options.sigma_angular_acceleration_rps2};
  memory_s_ = options.motion_memory_s;
}

void MotionNoise::reset() { linear_ = angular_ = VarianceScale(0.0, 0.0); }

double MotionNoise::jerkProbability() const {
  return (kPriorJerks + jerks_) / (kPriorImages + images_);
}

void MotionNoise::countImage(bool is_jerk) {
  ++images_;
  if (is_jerk) ++jerks_;
}

void MotionNoise::rescale(double factor) {
  linear_ = VarianceScale(factor * factor * linear_.scale(), linear_.degrees());
}

Accelerations MotionNoise::expected() const {
  const double factor = longRunFactor(interval_s_);
  return {predictiveSigma(linear_, factor, widest_.linear_mps2),
          predictiveSigma(angular_, factor, widest_.angular_rps2)};
}

void MotionNoise::learn(const UpdateReport& report, const Accelerations& allowed,
                        double interval_s) {
  if (!(interval_s > 0.0)) return;
  interval_s_ = interval_s;
  const double most = kImageDegrees * std::max(kFewestImages, memory_s_ / interval_s);
  learnImpulse(report.linear, allowed.linear_mps2, most, &linear_);
  learnImpulse(report.angular, allowed.angular_rps2, most, &angular_);
}

}  // namespace active_matching_slam
