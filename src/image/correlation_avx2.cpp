#include "correlation_kernels.h"

#if defined(__x86_64__)

#include <immintrin.h>

#include <cstring>

// From here on code is for AVX2, so nothing of the standard library may be compiled below: the
// linker could prefer it elsewhere. Reached only on processors that have it.
#pragma GCC push_options
#pragma GCC target("avx2")

#include "correlation_kernel_body.h"
#include "correlation_sse2.h"

namespace active_matching_slam {
namespace {

struct Avx2Ops {
  using Vector = std::int32_t __attribute__((vector_size(32)));
  template <int N>
  static void dot(const std::int16_t* window, std::ptrdiff_t stride, const std::int16_t* taps,
                  int size, std::int32_t* dots) {
    if constexpr (N < 16) {
      Sse2Ops::dot<N>(window, stride, taps, size, dots);
    } else {
      constexpr int kBlocks = N / 16;
      __m256i even[kBlocks], odd[kBlocks];
      for (int b = 0; b < kBlocks; ++b) even[b] = odd[b] = _mm256_setzero_si256();
      for (int row = 0; row < size; ++row) {
        const std::int16_t* line = window + row * stride;
        const std::int16_t* row_taps = taps + row * (size + 1);
        for (int column = 0; column < size; column += 2) {
          const __m256i pair = _mm256_set1_epi32(loadPair(row_taps + column));
          for (int b = 0; b < kBlocks; ++b) {
            const auto* at = reinterpret_cast<const __m256i*>(line + column + 16 * b);
            const auto* next = reinterpret_cast<const __m256i*>(line + column + 16 * b + 1);
            even[b] = _mm256_add_epi32(even[b], _mm256_madd_epi16(_mm256_loadu_si256(at), pair));
            odd[b] = _mm256_add_epi32(odd[b], _mm256_madd_epi16(_mm256_loadu_si256(next), pair));
          }
        }
      }
      for (int b = 0; b < kBlocks; ++b) {
        const __m256i low = _mm256_unpacklo_epi32(even[b], odd[b]);
        const __m256i high = _mm256_unpackhi_epi32(even[b], odd[b]);
        auto* out = reinterpret_cast<__m256i*>(dots + 16 * b);
        _mm256_storeu_si256(out, _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256(out + 1, _mm256_permute2x128_si256(low, high, 0x31));
      }
    }
  }
  template <int N>
  static void divideByRoot(const float* products, const float* energies, float least,
                           float* scores) {
    const __m256 one = _mm256_set1_ps(1.0f), minus_one = _mm256_set1_ps(-1.0f);
    for (int i = 0; i < N; i += 8) {
      const __m256 energy = _mm256_loadu_ps(energies + i);
      const __m256 textured = _mm256_cmp_ps(energy, _mm256_set1_ps(least), _CMP_GE_OQ);
      const __m256 score = _mm256_div_ps(_mm256_loadu_ps(products + i), _mm256_sqrt_ps(energy));
      _mm256_storeu_ps(
          scores + i, _mm256_and_ps(textured, _mm256_max_ps(_mm256_min_ps(score, one), minus_one)));
    }
  }
};

}  // namespace

#pragma GCC pop_options

const CorrelationKernels* avx2Kernels() {
  static constexpr CorrelationKernels kernels{scoreRun<Avx2Ops>, addRow, exchangeRow};
  return __builtin_cpu_supports("avx2") ? &kernels : nullptr;
}

}  // namespace active_matching_slam

#endif
