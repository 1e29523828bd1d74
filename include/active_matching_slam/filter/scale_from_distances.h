#pragma once

#include <optional>
#include <vector>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {

/// What is known of the distance between two features.
struct KnownDistance {
  FeatureId first, second;
  double metres;
  double sigma_m;  ///< standard deviation, independent of the others'
};

/// Metres a map unit, from distances that are known.
struct ScaleEstimate {
  double factor;
  double sigma;  ///< relative standard deviation, the map's and the distances' together
  double chi2;   ///< of the distances' ratios to each other
  int degrees;   ///< of freedom of chi2
  Eigen::VectorXd functional;  ///< g: reads the relative scale off an error of the state
  double distance_variance;    ///< part of the distances in the square of sigma
};

/// The generalised least squares estimate of one factor for all distances: the logarithm of each
/// distance in the map is, to first order, Gaussian by the filter's covariance. Empty unless there
/// are two distances or more, all between points (FeatureKind::kPoint).
std::optional<ScaleEstimate> estimateScale(const Ekf& filter,
                                           const std::vector<KnownDistance>& distances);

/// Multiplies all lengths by the factor, and takes the known distances for the unit in place of
/// what had been: the errors e of the state become e - x (g e - n), with x the generator of scale
/// and n the error of the known distances (an S-transformation, Baarda 1973). `estimate` is of this
/// state.
void takeScale(const ScaleEstimate& estimate, Ekf* filter);

}  // namespace active_matching_slam
