#pragma once

#include <cstdint>

namespace active_matching_slam {

/// Identifies a map feature for as long as the map lives; never reused.
using FeatureId = std::int64_t;

}  // namespace active_matching_slam
