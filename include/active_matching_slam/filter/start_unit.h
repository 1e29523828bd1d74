#pragma once

#include <Eigen/Core>
#include <limits>
#include <utility>
#include <vector>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {

/// Relative standard deviation of the length of `way` [m], whose covariance is `covariance` [m^2].
double relativeLengthSigma(const Eigen::Vector3d& way, const Eigen::Matrix3d& covariance);

/// The unit of length of a start with free scale: the mean log distance of its features from the
/// first camera, in which each counts its share. It stays while the start is adjusted over and
/// over.
class StartUnit {
 public:
  struct Choice {
    Eigen::VectorXd shares;  ///< of the features; sum 1
    double sigma = 0.0;      ///< of that mean, where the unit before is one
    bool is_kept = false;    ///< the one before
  };

  void reset() { *this = StartUnit(); }
  bool isChosen() const { return !shares_.empty(); }

  /// For an adjustment of the features `ids`, ascending, after which `anew` would be what they
  /// count (depthShares()): the unit before, by those features that the filter still has, as
  /// uncertain as what is gone leaves it in the filter's map. Chosen anew when most of what counted
  /// is gone, or as long as lengths were so vague that another unit makes no difference to what was
  /// told in this one.
  Choice choose(const Ekf& filter, const std::vector<FeatureId>& ids, Eigen::VectorXd anew);

  /// `choice` is the unit from now on.
  void adopt(const std::vector<FeatureId>& ids, const Choice& choice);

 private:
  std::vector<std::pair<FeatureId, double>> shares_;  ///< as chosen last; ascending id
  /// Relative, of the way from the first camera; the least so far.
  double length_sigma_ = std::numeric_limits<double>::infinity();
};

}  // namespace active_matching_slam
