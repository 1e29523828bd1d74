#pragma once

namespace active_matching_slam {

/// Sets OpenBLAS, when that is the BLAS in use, to stay on the caller's thread: matrices of a few
/// hundred rows gain nothing from more, and results must not depend on the number of cores. Applies
/// to the whole process: for main() alone to call, never for a library. A nodelet's manager is
/// set by OPENBLAS_NUM_THREADS=1 in its environment.
void useSingleThreadedBlas();

}  // namespace active_matching_slam
