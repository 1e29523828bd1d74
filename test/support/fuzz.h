#pragma once

#include <cstdlib>

namespace active_matching_slam {

/// How many malformed inputs a test tries: AMS_FUZZ_INPUTS from the environment, or `usual`.
inline int fuzzInputs(int usual) {
  const char* wanted = std::getenv("AMS_FUZZ_INPUTS");
  return wanted ? std::atoi(wanted) : usual;
}

}  // namespace active_matching_slam
