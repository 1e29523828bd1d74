#pragma once

#include <time.h>

namespace active_matching_slam {

/// Seconds of this thread: what a core spent, whoever else was busy.
inline double threadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace active_matching_slam
