#pragma once

#include <Eigen/Core>

namespace active_matching_slam {

/// Distinct color for a submap label, red, green, blue in 0 to 1; grey for none (-1). Same label,
/// same color, wherever submaps are shown.
Eigen::Vector3f submapRgb(int submap);

}  // namespace active_matching_slam
