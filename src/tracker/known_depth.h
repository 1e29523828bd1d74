#pragma once

#include <cstddef>

namespace active_matching_slam {

/// Relative standard deviation of an inverse depth below which it counts as known. Derivation:
/// infinity is five sigma away.
inline constexpr double kKnownDepthSigma = 0.2;
/// Neighbours whose median depth is taken. Derivation: the fewest whose median two outliers can't
/// move away.
inline constexpr std::ptrdiff_t kNeighbours = 5;

}  // namespace active_matching_slam
