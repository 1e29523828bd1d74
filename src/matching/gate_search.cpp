#include "gate_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <numeric>

namespace active_matching_slam {

std::vector<std::vector<int>> searchFullGates(const ProperPrior& prior, BudgetedSearch& budgeted,
                                              bool* cut_short) {
  std::vector<int> order(static_cast<std::size_t>(prior.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&prior](int a, int b) {
    return prior.covariance(a).determinant() < prior.covariance(b).determinant();
  });
  std::vector<std::vector<int>> gates(order.size());
  for (const int f : order) {
    if (budgeted.isOverBudget()) {
      *cut_short = true;
      break;
    }
    gates[static_cast<std::size_t>(f)] =
        budgeted.search(f, {prior.mean(f), prior.covariance(f)}).matches;
  }
  return gates;
}

int bestScore(const std::vector<SearchMatch>& matches, const std::vector<int>& among) {
  int best = -1;
  for (const int m : among)
    if (best < 0 ||
        matches[static_cast<std::size_t>(m)].score > matches[static_cast<std::size_t>(best)].score)
      best = m;
  return best;
}

}  // namespace active_matching_slam
