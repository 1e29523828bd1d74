#pragma once

namespace active_matching_slam {

/// Scale of a variance by its conjugate prior, the inverse gamma distribution: as sure as `degrees`
/// observed degrees of freedom. Forgetting makes it follow a scale that drifts (Särkkä & Nummenmaa,
/// Recursive noise adaptive Kalman filtering, IEEE TAC 2009).
class VarianceScale {
 public:
  VarianceScale(double scale, double degrees) : scale_(scale), degrees_(degrees) {}
  double scale() const { return scale_; }
  double degrees() const { return degrees_; }
  /// Posterior after residuals whose squares, over their variances for a scale of 1, add up to
  /// `squares` where `degrees` are expected.
  void learn(double squares, double degrees) {
    scale_ = (degrees_ * scale_ + squares) / (degrees_ + degrees);
    degrees_ += degrees;
  }
  /// `factor` in (0, 1] of the degrees are kept.
  void forget(double factor) { degrees_ *= factor; }

 private:
  double scale_, degrees_;
};

}  // namespace active_matching_slam
