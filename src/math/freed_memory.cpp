#include "active_matching_slam/math/freed_memory.h"

#include <cstdlib>  // __GLIBC__

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace active_matching_slam {

void keepFreedMemory() {
#ifdef __GLIBC__
  constexpr int kMiB = 1 << 20;
  ::mallopt(M_MMAP_THRESHOLD, 32 * kMiB);  // the most that glibc allows
  ::mallopt(M_TRIM_THRESHOLD, 128 * kMiB);
#endif
}

}  // namespace active_matching_slam
