#pragma once

#include <cstdlib>
#include <string>

namespace active_matching_slam {

/// Folder of the recorded sequences, from the environment variable AMS_DATA; empty when unset.
inline std::string recordedDataFolder() {
  const char* folder = std::getenv("AMS_DATA");
  return folder ? folder : "";
}

}  // namespace active_matching_slam
