#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/filter/variance_scale.h"

namespace active_matching_slam {

/// Noise of a landmark's matches by their residuals: its variance relative to other landmarks', and
/// its correlation over time.
class LandmarkNoise {
 public:
  /// Variance factor, 1 for a landmark like the others. Hierarchical prior: so until it has
  /// residuals of its own.
  double scale() const { return scale_.scale(); }

  /// `residual`: post-fit, per axis over the root of its redundancy and over its standard deviation
  /// for a scale of 1.
  void learn(const Eigen::Vector2d& residual);

  /// Square of the exponentially weighted mean of the last residuals, over what it is for white
  /// ones: its expectation is the variance inflation factor (see MeasurementNoise). Per axis; 0
  /// degrees: too few residuals.
  double inflation() const {
    return mean_variance_ > 0.0 ? 0.5 * mean_.squaredNorm() / mean_variance_ : 0.0;
  }
  bool hasInflation() const { return residuals_ >= kWindow; }

  /// Residuals that the exponential window of the mean spans: about the lag up to which their
  /// autocorrelation counts. Cost: the longer, the later it is known of a landmark.
  static constexpr int kWindow = 16;

 private:
  VarianceScale scale_{1.0, kPriorDegrees};
  Eigen::Vector2d mean_ = Eigen::Vector2d::Zero();
  double mean_variance_ = 0.0;
  int residuals_ = 0;

  /// Prior of the scale. Derivation: landmarks differ by sqrt(2 / degrees) = 22 % in variance.
  static constexpr double kPriorDegrees = 40.0;
};

/// Precision of a match by the least-squares fit of its template (TemplateFit), if any.
struct FitPrecision {
  double sigma_px = 0.0;  ///< per axis; 0: the fit did not converge
};

/// Variance of the image's measurements, learnt while tracking. doc/theory/noise.md
///
///   R_ik = max(sigma_min^2, c_k lambda_i s_ik^2) Sigma_ik
///
/// s_ik^2 Sigma_ik is the covariance that least squares give to the fit of landmark i's template in
/// image k (Förstner 1982); lambda_i the landmark's variance factor; c_k the a-posteriori variance
/// of unit weight, common to all matches, by variance component estimation from post-fit residuals.
/// Errors are correlated over time: what the state is corrected by them is as from white noise of
/// `inflation()` times the variance, their long-run variance (Newey & West 1987).
class MeasurementNoise {
 public:
  explicit MeasurementNoise(const FilterOptions& options) : options_(options) {}
  void setOptions(const FilterOptions& options) { options_ = options; }
  void reset() { *this = MeasurementNoise(options_); }

  /// Standard deviation per axis [px] of a match of `landmark` in the image in hand, at least
  /// FilterOptions::minimum_sigma_px; FilterOptions::sigma_px without a fit.
  double sigma_px(const FitPrecision& fit, const LandmarkNoise& landmark) const;
  /// The same of a typical match in the last image; before any, FilterOptions::sigma_px.
  double typicalSigma_px() const;
  /// c_k, as learnt so far; 0: nothing is.
  double varianceFactor() const { return has_learnt_ ? scale_.scale() : 0.0; }
  /// Degrees of freedom of the prior of c_k in the image in hand.
  double degrees() const;
  /// FeatureMeasurement::variance_inflation of such a match: its long-run variance over its
  /// variance.
  double inflation(const FitPrecision& fit, const LandmarkNoise& landmark) const;
  /// Of a typical match, at least 1.
  double inflation() const { return std::max(1.0, inflation_.scale()); }
  /// Standard deviation per axis [px] that a match to be searched for is predicted with: at most
  /// FilterOptions::sigma_px of it is noise. Of `landmark`, and of one like most.
  double gateSigma_px(const LandmarkNoise& landmark) const;
  double gateSigma_px() const { return gateSigma_px(LandmarkNoise()); }

  /// The same with a variance factor of 1 and without the lower bound.
  double unscaledSigma_px(const FitPrecision& fit) const;

  /// A new image, `interval_s` after the last: c_k has drifted since.
  void predict(double interval_s);
  /// `fits` of the matches fused in the image in hand.
  void observeFits(const std::vector<FitPrecision>& fits);
  /// `scale`: variance of the residuals over what was expected of them, `redundancy` degrees of
  /// freedom (UpdateReport).
  void learn(double scale, double redundancy);
  /// `inflations`: LandmarkNoise::inflation() of the matches fused.
  void learnInflation(const std::vector<double>& inflations);

 private:
  FilterOptions options_;
  VarianceScale scale_{1.0, 0.0};  ///< c_k
  VarianceScale inflation_{1.0, 0.0};
  double fit_px_ = 0.0;  ///< median s_ik of the last image; 0: unknown
  bool has_learnt_ = false;
};

}  // namespace active_matching_slam
