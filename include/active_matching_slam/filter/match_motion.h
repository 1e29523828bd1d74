#pragma once

#include <vector>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {

/// Lengths [px] of the ways in the image of the features that both have, each by ascending id.
std::vector<double> matchMotions(const std::vector<FeatureMeasurement>& from,
                                 const std::vector<FeatureMeasurement>& to);

}  // namespace active_matching_slam
