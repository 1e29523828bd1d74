#include "tool_main.h"

#include <exception>
#include <iostream>

#include "active_matching_slam/math/blas_threads.h"

namespace active_matching_slam {

int runTool(const std::string& name, const std::function<int()>& run) {
  useSingleThreadedBlas();
  try {
    return run();
  } catch (const std::exception& error) {
    std::string line = error.what();
    for (char& c : line)
      if (c == '\n' || c == '\r') c = ' ';
    std::cerr << name << ": " << line << "\n";
    return kToolFault;
  }
}

}  // namespace active_matching_slam
