#pragma once

#include <string>

namespace active_matching_slam {

/// The frame's name as tf2 takes it: without the leading slash that tf had.
inline std::string withoutLeadingSlash(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

}  // namespace active_matching_slam
