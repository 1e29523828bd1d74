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

/// The active map of a filter.
class EkfActiveMap : public ActiveMap {
 public:
  explicit EkfActiveMap(Ekf& filter) : filter_(filter) {}

  PointGaussian points() const override { return activePoints(filter_); }
  Eigen::MatrixXd covariance() const override { return filter_.covariance(); }
  std::vector<int> rows() const override { return activePointRows(filter_); }
  void insert(const Conditional& points) override {
    const PointInsertion insertion = pointInsertion(filter_, points);
    filter_.insertFeatures(insertion.features, insertion.own_covariance,
                           insertion.cross_covariance);
  }
  void remove(const std::vector<FeatureId>& ids) override { filter_.removeFeatures(ids); }
  void inflate(const Eigen::MatrixXd& added) override { filter_.inflate(added); }

 private:
  Ekf& filter_;
};

}  // namespace active_matching_slam
