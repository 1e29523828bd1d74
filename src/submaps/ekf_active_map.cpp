#include "active_matching_slam/submaps/ekf_active_map.h"

#include <algorithm>
#include <numeric>

#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {

using Eigen::Index;
using Eigen::MatrixXd;

PointGaussian activePoints(const Ekf& filter) {
  PointGaussian points;
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind == FeatureKind::kPoint) points.ids.push_back(feature.id);
  }
  const CameraState& camera = filter.camera();
  points.mean.resize(CameraError::kCalibrationSize + 3 * static_cast<Index>(points.ids.size()));
  Index row = 0;
  for (double value : {camera.readout_s, camera.lens.focal, camera.lens.radial,
                       camera.lens.centre.x(), camera.lens.centre.y()}) {
    points.mean(row++) = value;
  }
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind != FeatureKind::kPoint) continue;
    points.mean.segment<3>(row) = feature.point_world;
    row += 3;
  }
  const std::vector<int> rows = activePointRows(filter);
  points.covariance = selectBlock(filter.covariance(), rows, rows);
  return points;
}

std::vector<int> activePointRows(const Ekf& filter) {
  std::vector<int> rows(CameraError::kCalibrationSize);
  std::iota(rows.begin(), rows.end(), static_cast<int>(CameraError::kMotionSize));
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind != FeatureKind::kPoint) continue;
    for (int axis = 0; axis < 3; ++axis) rows.push_back(feature.offset + axis);
  }
  return rows;
}

PointInsertion pointInsertion(const Ekf& filter, const Conditional& points) {
  const PointGaussian active = activePoints(filter);
  const std::vector<int> all_rows = activePointRows(filter);
  const int calibration = active.calibrationSize();
  std::vector<int> given(all_rows.begin(), all_rows.begin() + calibration);
  for (int row : rowsOf(calibration, indicesOf(points.given_ids, active.ids))) {
    given.push_back(all_rows[slot(row)]);
  }
  std::vector<int> order(points.ids.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return points.ids[slot(a)] < points.ids[slot(b)]; });
  Conditional sorted = points;
  for (std::size_t i = 0; i < order.size(); ++i) sorted.ids[i] = points.ids[slot(order[i])];
  sorted = marginal(points, sorted.ids);

  PointInsertion insertion;
  const Eigen::VectorXd mean = sorted.meanAt(active);
  for (std::size_t i = 0; i < sorted.ids.size(); ++i) {
    FeatureState feature;
    feature.id = sorted.ids[i];
    feature.kind = FeatureKind::kPoint;
    feature.point_world = mean.segment<3>(static_cast<Index>(3 * i));
    insertion.features.push_back(feature);
  }
  std::vector<int> state(slot(filter.stateSize()));
  std::iota(state.begin(), state.end(), 0);
  insertion.cross_covariance = sorted.K * selectBlock(filter.covariance(), given, state);
  insertion.own_covariance = sorted.ownCovariance(insertion.cross_covariance, given);
  return insertion;
}

}  // namespace active_matching_slam
