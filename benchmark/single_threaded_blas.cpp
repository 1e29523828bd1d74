// Linked into every benchmark: times are those of one core, as in the node.

#include "active_matching_slam/math/blas_threads.h"

namespace active_matching_slam {
namespace {

const bool kIsSet = (useSingleThreadedBlas(), true);

}  // namespace
}  // namespace active_matching_slam
