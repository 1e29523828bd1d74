#include "correlation_kernels.h"

#if defined(__x86_64__)

#include "correlation_kernel_body.h"
#include "correlation_sse2.h"

namespace active_matching_slam {

const CorrelationKernels* sse2Kernels() {
  static constexpr CorrelationKernels kernels{scoreRun<Sse2Ops>, addRow, exchangeRow};
  return &kernels;
}

}  // namespace active_matching_slam

#endif
