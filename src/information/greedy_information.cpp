#include "active_matching_slam/information/greedy_information.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <queue>

namespace active_matching_slam {
namespace {

using Covariance = Eigen::Matrix<double, 12, 12>;

Eigen::Matrix2d innovationCovariance(const InformativeMeasurement& m, const Covariance& P) {
  return Eigen::Matrix2d::Identity() + m.W * P * m.W.transpose();
}

double expectedBits(const InformativeMeasurement& m, const Covariance& P) {
  const double determinant = innovationCovariance(m, P).determinant();
  return m.probability * (0.5 * std::log2(std::max(determinant, 1.0)) + m.own_bits);
}

/// A measurement in the queue, with a bound of what it brings.
struct Entry {
  double bits;  ///< when `chosen` others were
  double bits_per_cost;
  int index;
  std::size_t chosen;
  bool operator<(const Entry& other) const {
    return bits_per_cost != other.bits_per_cost ? bits_per_cost < other.bits_per_cost
                                                : index > other.index;
  }
};

}  // namespace

double informationBits(const InformativeMeasurement& measurement) {
  return expectedBits({measurement.W, 0.0, 1.0, 1.0}, Covariance::Identity());
}

GreedyChoice chooseByInformation(const std::vector<InformativeMeasurement>& measurements,
                                 const ChoiceLimits& limits) {
  GreedyChoice choice;
  Covariance P = Covariance::Identity();
  std::priority_queue<Entry> queue;
  const auto push = [&](int index) {
    const InformativeMeasurement& m = measurements[static_cast<std::size_t>(index)];
    const double bits = expectedBits(m, P);
    queue.push({bits, bits / m.cost, index, choice.order.size()});
  };
  for (int i = 0; i < static_cast<int>(measurements.size()); ++i) push(i);
  double expected = 0.0;
  while (!queue.empty()) {
    const Entry best = queue.top();
    queue.pop();
    if (best.chosen < choice.order.size()) {
      push(best.index);
      continue;
    }
    const bool is_full = static_cast<int>(choice.order.size()) >= limits.most;
    if (is_full || (expected >= limits.least && best.bits < limits.stop_bits)) {
      choice.bits_left = std::max(choice.bits_left, best.bits);
      if (is_full) break;
      continue;
    }
    const InformativeMeasurement& m = measurements[static_cast<std::size_t>(best.index)];
    choice.order.push_back(best.index);
    choice.bits.push_back(best.bits);
    expected += m.probability;
    const Eigen::Matrix<double, 12, 2> PWt = P * m.W.transpose();
    P -= PWt * innovationCovariance(m, P).inverse() * PWt.transpose();
    P = (0.5 * (P + P.transpose())).eval();
  }
  return choice;
}

}  // namespace active_matching_slam
