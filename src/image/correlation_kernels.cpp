#include "correlation_kernels.h"

#include <cmath>

#include "correlation_kernel_body.h"

namespace active_matching_slam {
namespace {

/// Plain loops that compilers vectorise (widening multiply-add on ARM).
struct PortableOps {
  using Vector = std::int32_t __attribute__((vector_size(16)));
  template <int N>
  static void dot(const std::int16_t* window, std::ptrdiff_t stride, const std::int16_t* taps,
                  int size, std::int32_t* dots) {
    for (int i = 0; i < N; ++i) dots[i] = 0;
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        const std::int16_t* line = window + row * stride + column;
        const std::int16_t tap = taps[row * (size + 1) + column];
        for (int i = 0; i < N; ++i) dots[i] += tap * line[i];
      }
  }
  template <int N>
  static void divideByRoot(const float* products, const float* energies, float least,
                           float* scores) {
    for (int i = 0; i < N; ++i) {
      if (!(energies[i] >= least)) {
        scores[i] = 0.0f;
        continue;
      }
      const float score = products[i] / std::sqrt(energies[i]);
      scores[i] = score > 1.0f ? 1.0f : score < -1.0f ? -1.0f : score;
    }
  }
};

}  // namespace

const CorrelationKernels& portableKernels() {
  static constexpr CorrelationKernels kernels{scoreRun<PortableOps>, addRow, exchangeRow};
  return kernels;
}

#if !defined(__x86_64__)
const CorrelationKernels* sse2Kernels() { return nullptr; }
const CorrelationKernels* avx2Kernels() { return nullptr; }
#endif

}  // namespace active_matching_slam
