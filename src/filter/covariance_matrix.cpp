#include "active_matching_slam/filter/covariance_matrix.h"

#include <algorithm>

namespace active_matching_slam {

void CovarianceMatrix::reserve(int size) {
  if (size <= storage_.rows()) return;
  // Not a power of two, whose columns would fall into the same cache sets.
  const int capacity =
      (std::max(size, static_cast<int>(storage_.rows() * 3 / 2)) + 63) / 64 * 64 + 8;
  Eigen::MatrixXd grown(capacity, capacity);
  grown.topLeftCorner(size_, size_) = view();
  storage_.swap(grown);
}

void CovarianceMatrix::resize(int size) {
  size_ = 0;
  reserve(size);
  size_ = size;
}

void CovarianceMatrix::reset(int size) {
  resize(size);
  view().setZero();
}

void CovarianceMatrix::assign(const Eigen::MatrixXd& covariance) {
  resize(static_cast<int>(covariance.rows()));
  view() = covariance;
  mirrorLower();
}

void CovarianceMatrix::extend(int count) {
  const int old_size = size_;
  reserve(old_size + count);
  size_ = old_size + count;
  view().rightCols(count).setZero();
  view().bottomLeftCorner(count, old_size).setZero();
}

void CovarianceMatrix::keep(const std::vector<std::pair<int, int>>& ranges) {
  int target_column = 0;
  for (const auto& columns : ranges) {
    for (int c = 0; c < columns.second; ++c, ++target_column) {
      const double* source = &storage_.coeffRef(0, columns.first + c);
      double* target = &storage_.coeffRef(0, target_column);
      // Moves towards lower addresses only, so copying forwards is safe.
      for (const auto& rows : ranges) {
        if (target != source + rows.first)
          std::copy(source + rows.first, source + rows.first + rows.second, target);
        target += rows.second;
      }
    }
  }
  size_ = target_column;
}

void CovarianceMatrix::mirrorLower() {
  // Cost: a plain transposed copy would miss the cache at every element; a tile of 8 kB stays in
  // it.
  constexpr int kTile = 32;
  View P = view();
  for (int c = 0; c < size_; c += kTile) {
    const int columns = std::min(kTile, size_ - c);
    P.block(c, c, columns, columns).triangularView<Eigen::StrictlyUpper>() =
        P.block(c, c, columns, columns).transpose();
    for (int r = c + kTile; r < size_; r += kTile) {
      const int rows = std::min(kTile, size_ - r);
      P.block(c, r, columns, rows) = P.block(r, c, rows, columns).transpose();
    }
  }
}

}  // namespace active_matching_slam
