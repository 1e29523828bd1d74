#include "active_matching_slam/matching/false_alarm.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "active_matching_slam/information/gaussian_information.h"

namespace active_matching_slam {
namespace {

constexpr int kSeeds = 3;               ///< matches that fix a camera
constexpr double kLeastChance = 1e-12;  ///< keeps the logarithm finite

double logChoose(double n, double k) {
  return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0);
}

}  // namespace

double logFalseAlarms(const Eigen::MatrixXd& S, const std::vector<int>& matches,
                      const std::vector<int>& accepted) {
  const int n = static_cast<int>(matches.size()), k = static_cast<int>(accepted.size());
  if (k <= kSeeds) return std::numeric_limits<double>::infinity();
  const Eigen::LLT<Eigen::MatrixXd> factor(selectFeatures(S, accepted));
  if (factor.info() != Eigen::Success || !factor.matrixLLT().allFinite())
    return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd L = factor.solve(Eigen::MatrixXd::Identity(2 * k, 2 * k));
  double log_chances = 0.0;
  for (int a = 0; a < k; ++a) {
    const int i = accepted[a];
    // The others leave point a the covariance L_aa^-1.
    const double before = S.block<2, 2>(2 * i, 2 * i).determinant();
    const double after = 1.0 / L.block<2, 2>(2 * a, 2 * a).determinant();
    const double fraction = std::sqrt(std::clamp(after / before, 0.0, 1.0));
    const double chance = 1.0 - std::pow(1.0 - fraction, matches[i]);
    log_chances += std::log(std::max(chance, kLeastChance));
  }
  // Any three could have fixed the camera: each of the k contributes (k - 3) / k of its logarithm.
  log_chances *= static_cast<double>(k - kSeeds) / k;
  const double all = std::accumulate(matches.begin(), matches.end(), 0.0);
  return (logChoose(all, kSeeds) + logChoose(n - kSeeds, k - kSeeds) + log_chances) /
         std::log(10.0);
}

}  // namespace active_matching_slam
