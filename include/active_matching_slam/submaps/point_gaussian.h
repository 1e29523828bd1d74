#pragma once

#include <Eigen/Core>
#include <unordered_map>
#include <vector>

#include "active_matching_slam/math/feature_id.h"
#include "active_matching_slam/math/row_selection.h"

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

/// Rows of these points (indices) behind a calibration of so many rows.
std::vector<int> rowsOf(int calibration_size, const std::vector<int>& points);

/// Those of 0 ... count - 1 that are not among `indices`, ascending.
std::vector<int> othersOf(const std::vector<int>& indices, int count);

}  // namespace active_matching_slam
