#pragma once

#include <Eigen/Core>
#include <unordered_map>
#include <vector>

#include "active_matching_slam/math/feature_id.h"

namespace active_matching_slam {

/// Gaussian of what does not move: first the camera's calibration (none or a few numbers), then
/// points of the world, three rows each, with additive errors.
struct PointGaussian {
  std::vector<FeatureId> ids;  ///< of the points, in any order
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;

  int calibrationSize() const { return static_cast<int>(mean.size()) - 3 * pointCount(); }
  int pointCount() const { return static_cast<int>(ids.size()); }
  int firstRow(int i) const { return calibrationSize() + 3 * i; }  ///< of the i-th point
};

/// Where each id is in a list.
std::unordered_map<FeatureId, int> indicesOf(const std::vector<FeatureId>& ids);

/// Indices into `all` of `ids`, in their order. Throws std::invalid_argument naming an id that is
/// not there or is asked for twice.
std::vector<int> indicesOf(const std::vector<FeatureId>& ids, const std::vector<FeatureId>& all);

/// `first`, ... rows of the calibration and then of these points (indices).
std::vector<int> rowsOf(int calibration_size, const std::vector<int>& points,
                        bool with_calibration);

}  // namespace active_matching_slam
