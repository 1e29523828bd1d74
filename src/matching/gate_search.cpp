#include "gate_search.h"

namespace active_matching_slam {

std::vector<std::vector<int>> searchFullGates(const ProperPrior& prior, SearchLedger& ledger) {
  std::vector<std::vector<int>> gates;
  for (int f = 0; f < prior.size(); ++f)
    gates.push_back(ledger.search(f, {prior.mean(f), prior.covariance(f)}).matches);
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
