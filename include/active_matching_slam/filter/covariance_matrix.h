#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace active_matching_slam {

/// Symmetric matrix that grows and shrinks often: its storage keeps room to spare, so that adding
/// or removing a few rows neither allocates nor copies the rest. Both triangles are stored.
class CovarianceMatrix {
 public:
  using View = Eigen::Block<Eigen::MatrixXd>;
  using ConstView = Eigen::Block<const Eigen::MatrixXd>;

  int size() const { return size_; }
  View view() { return storage_.topLeftCorner(size_, size_); }
  ConstView view() const { return storage_.topLeftCorner(size_, size_); }

  /// size x size zeros.
  void reset(int size);
  /// The lower triangle of a square matrix.
  void assign(const Eigen::MatrixXd& covariance);
  /// Appends `count` rows and columns of zeros.
  void extend(int count);
  /// Keeps these ranges of rows and columns (begin, count), ascending and disjoint; the rest goes.
  void keep(const std::vector<std::pair<int, int>>& ranges);
  /// Copies the lower triangle over the upper.
  void mirrorLower();

 private:
  void reserve(int size);
  /// Of what was there nothing is kept.
  void resize(int size);

  Eigen::MatrixXd storage_;
  int size_ = 0;
};

}  // namespace active_matching_slam
