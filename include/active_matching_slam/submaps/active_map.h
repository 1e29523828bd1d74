#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/submaps/conditional.h"

namespace active_matching_slam {

/// The filter that holds the active map, as the tree of submaps needs it.
class ActiveMap {
 public:
  virtual ~ActiveMap() = default;

  /// Calibration and points (rays and the camera's motion are left out).
  virtual PointGaussian points() const = 0;
  /// Of the whole state.
  virtual Eigen::MatrixXd covariance() const = 0;
  /// Where the rows of points() are in covariance().
  virtual std::vector<int> rows() const = 0;

  /// New points, given some of points(): P_J. = K P_C. against the whole state,
  /// P_JJ = K P_CC K^T + Q. They keep their ids.
  virtual void insert(const Conditional& points) = 0;
  virtual void remove(const std::vector<FeatureId>& ids) = 0;
  /// Adds a positive semi-definite matrix to covariance().
  virtual void inflate(const Eigen::MatrixXd& added) = 0;
};

}  // namespace active_matching_slam
