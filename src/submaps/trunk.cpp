#include "active_matching_slam/submaps/trunk.h"

#include <unordered_map>

#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/semidefinite_factor.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd selectColumns(const MatrixXd& matrix, const std::vector<int>& columns) {
  MatrixXd selected(matrix.rows(), static_cast<Index>(columns.size()));
  for (Index k = 0; k < selected.cols(); ++k) {
    selected.col(k) = matrix.col(columns[slot(static_cast<int>(k))]);
  }
  return selected;
}

MatrixXd selectRowsOf(const MatrixXd& matrix, const std::vector<int>& rows) {
  return selectColumns(matrix.transpose(), rows).transpose();
}

VectorXd stacked(const VectorXd& first, const VectorXd& second) {
  VectorXd both(first.size() + second.size());
  both << first, second;
  return both;
}

MatrixXd symmetric(const MatrixXd& matrix) { return 0.5 * (matrix + matrix.transpose()); }

std::vector<FeatureId> idsAt(const std::vector<FeatureId>& ids, const std::vector<int>& indices) {
  std::vector<FeatureId> chosen;
  for (int i : indices) chosen.push_back(ids[slot(i)]);
  return chosen;
}

std::vector<FeatureId> idsWithout(const std::vector<FeatureId>& ids,
                                  const std::vector<FeatureId>& left_out) {
  return idsAt(ids, othersOf(indicesOf(left_out, ids), static_cast<int>(ids.size())));
}

/// Given all of `active`, with the means of now.
void giveAll(const PointGaussian& active, Conditional* now) {
  if (now->ids.empty()) {
    *now = {};
    now->K.resize(0, active.mean.size());
  } else {
    now->mean = now->meanAt(active);
    const MatrixXd K = std::move(now->K);
    const Index calibration = active.calibrationSize();
    now->K = MatrixXd::Zero(K.rows(), active.mean.size());
    now->K.leftCols(calibration) = K.leftCols(calibration);
    const std::vector<int> where = indicesOf(now->given_ids, active.ids);
    for (std::size_t i = 0; i < where.size(); ++i) {
      now->K.middleCols(active.firstRow(where[i]), 3) =
          K.middleCols(calibration + 3 * static_cast<Index>(i), 3);
    }
  }
  now->given_ids = active.ids;
  now->given_mean = active.mean;
}

/// Leaves out given points on which nothing depends.
void leaveOutGiven(const std::vector<FeatureId>& ids, Conditional* conditional) {
  const int calibration = conditional->calibrationSize();
  const std::vector<int> kept = othersOf(indicesOf(ids, conditional->given_ids),
                                         static_cast<int>(conditional->given_ids.size()));
  std::vector<int> columns(slot(calibration));
  for (int i = 0; i < calibration; ++i) columns[slot(i)] = i;
  const std::vector<int> of_points = rowsOf(calibration, kept);
  columns.insert(columns.end(), of_points.begin(), of_points.end());
  conditional->given_ids = idsAt(conditional->given_ids, kept);
  conditional->given_mean = selectRows(conditional->given_mean, columns);
  conditional->K = selectColumns(conditional->K, columns);
}

}  // namespace

void Trunk::refresh(const PointGaussian& active) { giveAll(active, &conditional_); }

Conditional Trunk::givenActive(const PointGaussian& active,
                               const std::vector<FeatureId>& ids) const {
  Conditional some = marginal(conditional_, ids);
  giveAll(active, &some);
  return some;
}

void Trunk::take(const PointGaussian& active, const std::vector<FeatureId>& ids) {
  if (ids.empty()) return;
  refresh(active);
  const Conditional moved = Conditional::of(active, ids, idsWithout(active.ids, ids));
  const int calibration = active.calibrationSize();
  const std::vector<int> taken = indicesOf(ids, active.ids);
  const MatrixXd K_T = selectColumns(conditional_.K, rowsOf(calibration, taken));
  std::vector<int> kept = rowsOf(calibration, othersOf(taken, active.pointCount()));
  MatrixXd K_A(conditional_.K.rows(), moved.K.cols());
  K_A << conditional_.K.leftCols(calibration), selectColumns(conditional_.K, kept);

  const Index before = conditional_.mean.size(), added = moved.mean.size();
  const MatrixXd cross = K_T * moved.Q;
  Conditional next;
  next.ids = conditional_.ids;
  next.ids.insert(next.ids.end(), ids.begin(), ids.end());
  next.mean = stacked(conditional_.mean, moved.mean);
  next.given_ids = moved.given_ids;
  next.given_mean = moved.given_mean;
  next.K.resize(before + added, moved.K.cols());
  next.K.topRows(before) = K_A + K_T * moved.K;
  next.K.bottomRows(added) = moved.K;
  next.Q.resize(before + added, before + added);
  next.Q.topLeftCorner(before, before) = symmetric(conditional_.Q + cross * K_T.transpose());
  next.Q.topRightCorner(before, added) = cross;
  next.Q.bottomLeftCorner(added, before) = cross.transpose();
  next.Q.bottomRightCorner(added, added) = moved.Q;
  conditional_ = std::move(next);
}

Conditional Trunk::give(const PointGaussian& active, const std::vector<FeatureId>& ids) {
  refresh(active);
  const std::vector<int> given = indicesOf(ids, conditional_.ids);
  const std::vector<int> rest = othersOf(given, static_cast<int>(conditional_.ids.size()));
  const std::vector<int> T = rowsOf(0, given), O = rowsOf(0, rest);
  const Conditional result = marginal(conditional_, ids);
  const SemidefiniteFactor factor(result.Q);
  const MatrixXd Q_TO = selectBlock(conditional_.Q, T, O);
  const MatrixXd half = factor.halfSolve(Q_TO);
  const MatrixXd B = factor.solve(Q_TO).transpose();

  Conditional next;
  next.ids = idsAt(conditional_.ids, rest);
  next.mean = selectRows(conditional_.mean, O);
  next.given_ids = conditional_.given_ids;
  next.given_ids.insert(next.given_ids.end(), ids.begin(), ids.end());
  next.given_mean = stacked(conditional_.given_mean, result.mean);
  next.K.resize(B.rows(), conditional_.K.cols() + B.cols());
  next.K << selectRowsOf(conditional_.K, O) - B * result.K, B;
  next.Q = selectBlock(conditional_.Q, O, O);
  next.Q.noalias() -= half.transpose() * half;
  conditional_ = std::move(next);
  return result;
}

void Trunk::marginalise(const PointGaussian& active, const std::vector<FeatureId>& ids) {
  if (empty()) return;
  // Most that leave for good are new, and nothing depends on them.
  std::vector<FeatureId> needed, idle;
  const std::unordered_map<FeatureId, int> where = indicesOf(conditional_.given_ids);
  for (const FeatureId id : ids) {
    const auto found = where.find(id);
    if (found == where.end()) continue;
    const Index column = conditional_.calibrationSize() + 3 * static_cast<Index>(found->second);
    (conditional_.K.middleCols(column, 3).isZero(0.0) ? idle : needed).push_back(id);
  }
  if (needed.empty()) {
    leaveOutGiven(idle, &conditional_);
    return;
  }
  take(active, ids);
  forget(ids);
}

bool Trunk::dependsOn(FeatureId id) const {
  for (std::size_t i = 0; i < conditional_.given_ids.size(); ++i) {
    if (conditional_.given_ids[i] != id) continue;
    const Index column = conditional_.calibrationSize() + 3 * static_cast<Index>(i);
    return !conditional_.K.middleCols(column, 3).isZero(0.0);
  }
  return false;
}

void Trunk::forget(const std::vector<FeatureId>& ids) {
  if (ids.empty()) return;
  conditional_ = marginal(conditional_, idsWithout(conditional_.ids, ids));
}

PointGaussian Trunk::joint(const PointGaussian& active, const std::vector<FeatureId>& ids) const {
  PointGaussian result = active;
  if (!ids.empty()) marginal(conditional_, ids).apply(result);
  return result;
}

void Trunk::inflate(const MatrixXd& added) { conditional_.Q += added; }

}  // namespace active_matching_slam
