#include "active_matching_slam/submaps/conditional.h"

#include <stdexcept>
#include <string>

#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/semidefinite_factor.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Rows of the calibration, then of these points.
std::vector<int> rowsWithCalibration(int calibration_size, const std::vector<int>& points) {
  std::vector<int> rows;
  for (int row = 0; row < calibration_size; ++row) rows.push_back(row);
  const std::vector<int> of_points = rowsOf(calibration_size, points);
  rows.insert(rows.end(), of_points.begin(), of_points.end());
  return rows;
}

std::vector<int> givenRows(const Conditional& conditional, const PointGaussian& joint) {
  if (joint.calibrationSize() != conditional.calibrationSize()) {
    throw std::invalid_argument(
        "calibration of " + std::to_string(joint.calibrationSize()) +
        " numbers, allowed: " + std::to_string(conditional.calibrationSize()));
  }
  return rowsWithCalibration(joint.calibrationSize(), indicesOf(conditional.given_ids, joint.ids));
}

}  // namespace

Conditional Conditional::of(const PointGaussian& joint, const std::vector<FeatureId>& ids,
                            const std::vector<FeatureId>& given_ids) {
  std::vector<FeatureId> all = given_ids;
  all.insert(all.end(), ids.begin(), ids.end());
  indicesOf(all, joint.ids);  // each there, and once
  const int calibration = joint.calibrationSize();
  const std::vector<int> own = rowsOf(calibration, indicesOf(ids, joint.ids));
  const std::vector<int> given = rowsWithCalibration(calibration, indicesOf(given_ids, joint.ids));
  const SemidefiniteFactor factor(selectBlock(joint.covariance, given, given));
  const MatrixXd cross = selectBlock(joint.covariance, given, own);
  const MatrixXd half = factor.halfSolve(cross);
  Conditional result;
  result.ids = ids;
  result.given_ids = given_ids;
  result.mean = selectRows(joint.mean, own);
  result.given_mean = selectRows(joint.mean, given);
  result.K = factor.solve(cross).transpose();
  result.Q = selectBlock(joint.covariance, own, own);
  result.Q.noalias() -= half.transpose() * half;
  return result;
}

Eigen::VectorXd Conditional::meanAt(const PointGaussian& joint) const {
  return mean + K * (selectRows(joint.mean, givenRows(*this, joint)) - given_mean);
}

void Conditional::apply(PointGaussian& joint) const {
  const std::vector<int> given = givenRows(*this, joint);
  const Index before = joint.mean.size(), added = mean.size();
  std::vector<int> all(slot(static_cast<int>(before)));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const MatrixXd cross = K * selectBlock(joint.covariance, given, all);
  const Eigen::VectorXd own_mean = meanAt(joint);
  joint.mean.conservativeResize(before + added);
  joint.mean.tail(added) = own_mean;
  joint.covariance.conservativeResize(before + added, before + added);
  joint.covariance.bottomLeftCorner(added, before) = cross;
  joint.covariance.topRightCorner(before, added) = cross.transpose();
  joint.covariance.bottomRightCorner(added, added) = ownCovariance(cross, given);
  joint.ids.insert(joint.ids.end(), ids.begin(), ids.end());
}

MatrixXd Conditional::ownCovariance(const Eigen::Ref<const MatrixXd>& cross,
                                    const std::vector<int>& given) const {
  MatrixXd with_given(cross.rows(), K.cols());
  for (Index k = 0; k < K.cols(); ++k) {
    with_given.col(k) = cross.col(given[slot(static_cast<int>(k))]);
  }
  MatrixXd own = Q;
  own.noalias() += with_given * K.transpose();
  return 0.5 * (own + own.transpose());
}

void Conditional::rescale(double factor) {
  const int calibration = calibrationSize();
  mean *= factor;
  given_mean.tail(given_mean.size() - calibration) *= factor;
  K.leftCols(calibration) *= factor;
  Q *= factor * factor;
}

Conditional marginal(const Conditional& conditional, const std::vector<FeatureId>& ids) {
  const std::vector<int> rows = rowsOf(0, indicesOf(ids, conditional.ids));
  Conditional result;
  result.ids = ids;
  result.given_ids = conditional.given_ids;
  result.given_mean = conditional.given_mean;
  result.mean = selectRows(conditional.mean, rows);
  result.K.resize(static_cast<Index>(rows.size()), conditional.K.cols());
  for (Index i = 0; i < result.K.rows(); ++i) {
    result.K.row(i) = conditional.K.row(rows[slot(static_cast<int>(i))]);
  }
  result.Q = selectBlock(conditional.Q, rows, rows);
  return result;
}

}  // namespace active_matching_slam
