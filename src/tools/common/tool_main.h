#pragma once

#include <functional>
#include <string>

namespace active_matching_slam {

constexpr int kToolFault = 2;  ///< exit status

/// What `run` returns; kToolFault where it throws, and one line on stderr that names tool and
/// fault.
int runTool(const std::string& name, const std::function<int()>& run);

}  // namespace active_matching_slam
