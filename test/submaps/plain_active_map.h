#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <random>
#include <vector>

#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/slot.h"
#include "active_matching_slam/submaps/active_map.h"

namespace active_matching_slam {
namespace test {

/// A linear Kalman filter of a camera's motion, which is moved and measured, a calibration and
/// points: the plainest active map, and, as it can hold all points at once, the reference.
class PlainActiveMap : public ActiveMap {
 public:
  /// `covariance`: of motion, calibration and points, in this order.
  PlainActiveMap(int motion_size, int calibration_size, std::vector<FeatureId> ids,
                 Eigen::VectorXd mean, Eigen::MatrixXd covariance)
      : motion_(motion_size),
        calibration_(calibration_size),
        ids_(std::move(ids)),
        mean_(std::move(mean)),
        P_(std::move(covariance)) {}

  PointGaussian points() const override {
    const std::vector<int> of_points = rows();
    return {ids_, selectRows(mean_, of_points), selectBlock(P_, of_points, of_points)};
  }
  Eigen::MatrixXd covariance() const override { return P_; }
  std::vector<int> rows() const override {
    std::vector<int> result;
    for (int row = motion_; row < static_cast<int>(mean_.size()); ++row) result.push_back(row);
    return result;
  }
  void insert(const Conditional& points) override {
    // The camera goes along as if it were a part of the calibration.
    PointGaussian state{ids_, mean_, P_};
    Conditional padded = points;
    padded.given_mean.resize(points.given_mean.size() + motion_);
    padded.given_mean << mean_.head(motion_), points.given_mean;
    padded.K = Eigen::MatrixXd::Zero(points.K.rows(), points.K.cols() + motion_);
    padded.K.rightCols(points.K.cols()) = points.K;
    padded.apply(state);
    ids_ = state.ids;
    mean_ = state.mean;
    P_ = state.covariance;
  }
  void remove(const std::vector<FeatureId>& ids) override {
    std::vector<int> kept;
    std::vector<FeatureId> kept_ids;
    for (int row = 0; row < motion_ + calibration_; ++row) kept.push_back(row);
    for (int i : othersOf(indicesOf(ids, ids_), static_cast<int>(ids_.size()))) {
      for (int axis = 0; axis < 3; ++axis) kept.push_back(motion_ + calibration_ + 3 * i + axis);
      kept_ids.push_back(ids_[slot(i)]);
    }
    ids_ = kept_ids;
    mean_ = selectRows(mean_, kept);
    P_ = selectBlock(P_, kept, kept);
  }
  void inflate(const Eigen::MatrixXd& added) override { P_ += added; }

  const std::vector<FeatureId>& ids() const { return ids_; }
  const Eigen::VectorXd& mean() const { return mean_; }
  int row(FeatureId id) const { return motion_ + calibration_ + 3 * indicesOf({id}, ids_).front(); }

  /// The motion moves by F and noise of variance Q.
  void move(const Eigen::MatrixXd& F, const Eigen::MatrixXd& Q) {
    mean_.head(motion_) = F * mean_.head(motion_);
    P_.topRows(motion_) = F * P_.topRows(motion_);
    P_.leftCols(motion_) = P_.leftCols(motion_) * F.transpose();
    P_.topLeftCorner(motion_, motion_) += Q;
  }
  /// z = H [motion; calibration; the point] of the point, noise R.
  void measure(FeatureId id, const Eigen::MatrixXd& H, const Eigen::VectorXd& z,
               const Eigen::MatrixXd& R) {
    update(jacobian(id, H), z, R);
  }
  Eigen::MatrixXd jacobian(FeatureId id, const Eigen::MatrixXd& H) const {
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(H.rows(), mean_.size());
    full.leftCols(motion_ + calibration_) = H.leftCols(motion_ + calibration_);
    full.middleCols(row(id), 3) = H.rightCols(3);
    return full;
  }
  void update(const Eigen::MatrixXd& H, const Eigen::VectorXd& z, const Eigen::MatrixXd& R) {
    const Eigen::MatrixXd S = H * P_ * H.transpose() + R;
    const Eigen::MatrixXd K = P_ * H.transpose() * S.inverse();
    mean_ += K * (z - H * mean_);
    P_ -= Eigen::MatrixXd(K * S * K.transpose());
    P_ = 0.5 * (P_ + P_.transpose()).eval();
  }

 private:
  int motion_, calibration_;
  std::vector<FeatureId> ids_;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd P_;
};

class RandomNumbers {
 public:
  explicit RandomNumbers(unsigned seed) : generator_(seed) {}
  Eigen::MatrixXd matrix(int rows, int columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [this]() { return normal_(generator_); });
  }

 private:
  std::mt19937 generator_;
  std::normal_distribution<double> normal_;
};

constexpr int kMotion = 6, kCalibration = 2;

/// A camera that knows of points 0 ... count - 1 by some of them alone: those of `linked`. Given
/// these the others are independent of it.
inline PlainActiveMap randomMap(int count, const std::vector<FeatureId>& linked, unsigned seed) {
  RandomNumbers random(seed);
  const int still = kCalibration + 3 * count, size = kMotion + still;
  const Eigen::MatrixXd causes = random.matrix(still, still + 5);
  Eigen::MatrixXd P(size, size);
  P.bottomRightCorner(still, still) = causes * causes.transpose() / still;
  Eigen::MatrixXd F = Eigen::MatrixXd::Zero(kMotion, still);
  F.leftCols(kCalibration) = random.matrix(kMotion, kCalibration);
  for (FeatureId id : linked) {
    F.middleCols(kCalibration + 3 * static_cast<int>(id), 3) = random.matrix(kMotion, 3);
  }
  P.topRightCorner(kMotion, still) = F * P.bottomRightCorner(still, still);
  P.bottomLeftCorner(still, kMotion) = P.topRightCorner(kMotion, still).transpose();
  P.topLeftCorner(kMotion, kMotion) = F * P.topRightCorner(kMotion, still).transpose() +
                                      Eigen::MatrixXd::Identity(kMotion, kMotion);
  P = 0.5 * (P + P.transpose()).eval();
  std::vector<FeatureId> ids;
  for (int i = 0; i < count; ++i) ids.push_back(i);
  return {kMotion, kCalibration, ids, random.matrix(size, 1), P};
}

/// A frame: the camera moves, and sees some points.
struct RandomFrame {
  Eigen::MatrixXd F, Q, H, z;
  std::vector<FeatureId> seen;
};

inline RandomFrame randomFrame(const std::vector<FeatureId>& seen, RandomNumbers& random) {
  const int rows = 2 * static_cast<int>(seen.size());
  return {Eigen::MatrixXd::Identity(kMotion, kMotion) + 0.1 * random.matrix(kMotion, kMotion),
          0.1 * Eigen::MatrixXd::Identity(kMotion, kMotion),
          random.matrix(rows, kMotion + kCalibration + 3), random.matrix(rows, 1), seen};
}

inline void run(const RandomFrame& frame, PlainActiveMap& map) {
  map.move(frame.F, frame.Q);
  for (std::size_t i = 0; i < frame.seen.size(); ++i) {
    const int row = 2 * static_cast<int>(i);
    map.measure(frame.seen[i], frame.H.middleRows(row, 2), frame.z.middleRows(row, 2),
                0.3 * Eigen::Matrix2d::Identity());
  }
}

inline std::vector<FeatureId> idsFrom(FeatureId begin, FeatureId end) {
  std::vector<FeatureId> ids;
  for (FeatureId id = begin; id < end; ++id) ids.push_back(id);
  return ids;
}

/// What two Gaussians say of the same points (and, if asked, of the motion), by the largest
/// difference of means and covariances, relative to the largest number.
inline double difference(const PointGaussian& a, const PointGaussian& b) {
  std::vector<int> rows;
  for (int row = 0; row < a.calibrationSize(); ++row) rows.push_back(row);
  for (int row : rowsOf(a.calibrationSize(), indicesOf(a.ids, b.ids))) rows.push_back(row);
  const Eigen::MatrixXd P = selectBlock(b.covariance, rows, rows);
  return std::max(
      (a.mean - selectRows(b.mean, rows)).lpNorm<Eigen::Infinity>() /
          std::max(1.0, a.mean.lpNorm<Eigen::Infinity>()),
      (a.covariance - P).lpNorm<Eigen::Infinity>() / a.covariance.lpNorm<Eigen::Infinity>());
}

}  // namespace test
}  // namespace active_matching_slam
