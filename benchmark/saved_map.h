#pragma once

#include <unistd.h>

#include <cstdio>
#include <stdexcept>

#include "active_matching_slam/map/map_file.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// What the tracker would save.
inline MapFileContent savedMap(const Tracker& tracker) {
  char path[] = "/tmp/saved_map_XXXXXX";
  const int file = ::mkstemp(path);
  if (file < 0) throw std::runtime_error("can't make a temporary file");
  ::close(file);
  tracker.saveMap(path);
  MapFileContent content = readMapFile(path);
  std::remove(path);
  return content;
}

}  // namespace active_matching_slam
