#pragma once

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/submaps/active_map.h"

namespace active_matching_slam {

/// Calibration and points of a filter.
PointGaussian activePoints(const Ekf& filter);
/// Where the rows of activePoints() are in the filter's covariance.
std::vector<int> activePointRows(const Ekf& filter);

/// Points to be inserted into a filter.
struct PointInsertion {
  std::vector<FeatureState> features;  ///< ascending id; offsets are the filter's to set
  Eigen::MatrixXd own_covariance;      ///< 3n x 3n
  Eigen::MatrixXd cross_covariance;    ///< 3n x filter.stateSize()
};

/// Points given some of the filter's: their means, and their covariances with the whole state.
PointInsertion pointInsertion(const Ekf& filter, const Conditional& points);

}  // namespace active_matching_slam
