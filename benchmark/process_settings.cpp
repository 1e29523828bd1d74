// Linked into every benchmark: times are those of one core and a process set up as the node.

#include "active_matching_slam/math/blas_threads.h"
#include "active_matching_slam/math/freed_memory.h"

namespace active_matching_slam {
namespace {

const bool kIsSet = (useSingleThreadedBlas(), keepFreedMemory(), true);

}  // namespace
}  // namespace active_matching_slam
