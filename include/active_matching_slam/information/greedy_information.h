#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// A measurement that may be taken, or not, of an unknown c ~ N(0, I) of 12 dimensions: z = W c +
/// n, n ~ N(0, I_2). Besides it tells `own_bits` of something that no other measurement tells of.
/// It fails with probability 1 - `probability` and has a cost.
struct InformativeMeasurement {
  using Jacobian = Eigen::Matrix<double, 2, 12>;
  Jacobian W;
  double own_bits = 0.0;
  double probability = 1.0;
  double cost = 1.0;  ///< > 0, of any unit
};

/// What the measurement by itself tells of c [bit], 1/2 log2 det(I + W W^T) (Chli 2009, eq. 4.28).
double informationBits(const InformativeMeasurement& measurement);

/// When chooseByInformation() ends.
struct ChoiceLimits {
  int most = 0;            ///< measurements
  double least = 0.0;      ///< expected successes, before `stop_bits` counts
  double stop_bits = 0.0;  ///< the next one is left when it would bring less
};

struct GreedyChoice {
  std::vector<int> order;    ///< indices of the measurements, the best first
  std::vector<double> bits;  ///< of each, expected, given those before
  double bits_left = 0.0;    ///< the most that one which was left would bring; 0: none was
};

/// Measurements that together tell most of c for their cost: the next is the one of most expected
/// information a cost given those before. Information is submodular, so gains only fall: most are
/// evaluated once (lazy greedy, Minoux 1978), and what is chosen is within a constant factor of the
/// best set (Krause & Guestrin 2005; for features Zhao & Vela 2020).
GreedyChoice chooseByInformation(const std::vector<InformativeMeasurement>& measurements,
                                 const ChoiceLimits& limits);

}  // namespace active_matching_slam
