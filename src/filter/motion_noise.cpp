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

/// Prior of the probability of a jerk, as sure as so many images. Standard: contamination of 5 % in
/// robust statistics (Huber 1964).
constexpr double kPriorImages = 20.0, kPriorJerks = 1.0;

/// Standard deviation of the predictive distribution.
double predictiveSigma(const VarianceScale& scale, double widest) {
  if (!(scale.degrees() > 2.0)) return widest;
  return std::min(widest, std::sqrt(scale.scale() * scale.degrees() / (scale.degrees() - 2.0)));
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
  return {predictiveSigma(linear_, widest_.linear_mps2),
          predictiveSigma(angular_, widest_.angular_rps2)};
}

void MotionNoise::learn(const UpdateReport& report, const Accelerations& allowed,
                        double interval_s) {
  if (!(interval_s > 0.0)) return;
  const double most = kImageDegrees * std::max(kFewestImages, memory_s_ / interval_s);
  learnImpulse(report.linear, allowed.linear_mps2, most, &linear_);
  learnImpulse(report.angular, allowed.angular_rps2, most, &angular_);
}

}  // namespace active_matching_slam
