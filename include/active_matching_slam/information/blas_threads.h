#pragma once

namespace active_matching_slam {

/// Tells OpenBLAS, when that is the BLAS in use, to stay on the caller's thread: matrices of a few
/// hundred rows gain nothing from more, and results must not depend on the number of cores. Applies
/// to the whole process; every Ekf and every Matcher calls it when it is made.
void useSingleThreadedBlas();

}  // namespace active_matching_slam
