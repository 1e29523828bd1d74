#pragma once

#include <cstddef>

namespace active_matching_slam {

/// A feature's index, which is signed because -1 says "none", as a container's.
inline std::size_t slot(int i) { return static_cast<std::size_t>(i); }

}  // namespace active_matching_slam
