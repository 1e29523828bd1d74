#pragma once

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/filter/variance_scale.h"

namespace active_matching_slam {

/// Process noise of the constant velocity, learnt while tracking: the variances of linear and of
/// angular accelerations per axis, each by its conjugate prior with forgetting, from the impulses
/// that the updates resolve (variance component estimation; its fixed point is that of EM, Shumway
/// & Stoffer 1982). doc/theory/motion.md
class MotionNoise {
 public:
  explicit MotionNoise(const FilterOptions& options) { setOptions(options); }
  /// What is learnt stays.
  void setOptions(const FilterOptions& options);
  /// Nothing is known of the motion: the widest that the options expect.
  void reset();
  /// The unit of length becomes 1 / `factor` of what it was.
  void rescale(double factor);

  /// Standard deviations that the next image is predicted with: of the predictive distribution,
  /// Student's t, as a Gaussian of its variance; inflated to the long-run variance, since
  /// accelerations last; at most widest().
  Accelerations expected() const;
  Accelerations widest() const { return widest_; }

  /// Of an image in which an acceleration as wide as widest() is needed to explain the matches, by
  /// the images so far (a beta distribution).
  double jerkProbability() const;
  void countImage(bool is_jerk);

  /// Learns from an update after a prediction over `interval_s` with `allowed` accelerations.
  void learn(const UpdateReport& report, const Accelerations& allowed, double interval_s);

 private:
  Accelerations widest_;
  double memory_s_ = 0.0;
  double interval_s_ = 0.0;  ///< of the last update
  double images_ = 0.0, jerks_ = 0.0;
  VarianceScale linear_{0.0, 0.0}, angular_{0.0, 0.0};  ///< [(m/s^2)^2, (rad/s^2)^2]
};

}  // namespace active_matching_slam
