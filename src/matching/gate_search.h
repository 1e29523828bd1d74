#pragma once

#include <vector>

#include "budgeted_search.h"

namespace active_matching_slam {

/// Searches every feature's 3-sigma ellipse of the prior, the smallest first; [f] lists indices
/// into matches(f). Once the budget is used up the rest stays unsearched, and `cut_short` is set.
std::vector<std::vector<int>> searchFullGates(const ProperPrior& prior, BudgetedSearch& budgeted,
                                              bool* cut_short);

/// Of some matches of a feature the one of the highest score (ties: the first), -1 of none.
int bestScore(const std::vector<SearchMatch>& matches, const std::vector<int>& among);

}  // namespace active_matching_slam
