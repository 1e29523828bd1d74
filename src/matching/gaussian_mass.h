#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "active_matching_slam/matching/feature_search.h"

namespace active_matching_slam {

/// Probability mass of the Gaussian (mean, covariance) inside a whole 3-sigma ellipse, absolute
/// error below 1e-7. By Green's theorem in the Gaussian's whitened coordinates y
///   mass = (1 / 2 pi) contour integral of (1 - exp(-|y|^2 / 2)) / |y|^2 (y x dy),
/// whose integrand is smooth and periodic along the ellipse, so the trapezoidal rule converges
/// faster than any power of the number of nodes. Both covariances must be proper.
double massInEllipse(const SearchEllipse& ellipse, const Eigen::Vector2d& mean,
                     const Eigen::Matrix2d& covariance);

/// A 3-sigma ellipse clipped to the unit squares of a box of pixels: its border.
class ClippedEllipse {
 public:
  ClippedEllipse(const SearchEllipse& ellipse, const PixelBox& box);

  double area() const;  ///< [px^2]
  /// Probability mass of a Gaussian inside, absolute error below 1e-7.
  double mass(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance) const;

 private:
  Eigen::Vector2d center_, axis0_, axis1_;  // the ellipse is center + axis0 cos t + axis1 sin t
  std::vector<std::pair<double, double>> arcs_;  // [t0, t1], counter-clockwise
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> segments_;  // counter-clockwise
};

/// p(m), the mass of the pixel around m: density times one pixel, or, where the Gaussian is
/// narrower than pixels resolve (a sigma below 0.4 px), the integral over the pixel.
double massOfPixel(const Eigen::Vector2d& m, const Eigen::Vector2d& mean,
                   const Eigen::Matrix2d& covariance);

/// Sum of p over all pixel centres of the mask, absolute error below 1e-8.
double massOnPixels(const PixelMask& mask, const Eigen::Vector2d& mean,
                    const Eigen::Matrix2d& covariance);

/// Sum of p over disjoint runs, from `first` to the end.
double massOnRuns(const std::vector<PixelRun>& runs, std::size_t first, const Eigen::Vector2d& mean,
                  const Eigen::Matrix2d& covariance);

}  // namespace active_matching_slam
