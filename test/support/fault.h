#pragma once

#include <exception>
#include <functional>
#include <string>

namespace active_matching_slam {

/// What an action says was wrong; empty if nothing was.
inline std::string faultOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace active_matching_slam
