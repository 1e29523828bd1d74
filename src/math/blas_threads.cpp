#include "active_matching_slam/math/blas_threads.h"

// Weak: null where the BLAS is another one.
extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));

namespace active_matching_slam {

void useSingleThreadedBlas() {
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
}

}  // namespace active_matching_slam
