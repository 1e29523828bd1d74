#pragma once

#include <vector>

#include "search_ledger.h"

namespace active_matching_slam {

/// Searches every feature's 3-sigma ellipse of the prior; [f] lists indices into matches(f).
std::vector<std::vector<int>> searchFullGates(const ProperPrior& prior, SearchLedger& ledger);

/// Of some matches of a feature the one of the highest score (ties: the first), -1 of none.
int bestScore(const std::vector<SearchMatch>& matches, const std::vector<int>& among);

}  // namespace active_matching_slam
