#pragma once

// Kernel operations for every x86-64 processor; see correlation_kernel_body.h.

#include <emmintrin.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace active_matching_slam {
namespace {

// pmaddwd multiplies 16-bit numbers and adds neighbouring products: a load at u serves the even
// positions u, u + 2, ... with two taps at once, a load at u + 1 the odd ones.

inline std::int32_t loadPair(const std::int16_t* taps) {
  std::int32_t pair;
  std::memcpy(&pair, taps, sizeof(pair));
  return pair;
}

struct Sse2Ops {
  using Vector = std::int32_t __attribute__((vector_size(16)));
  template <int N>
  static void dot(const std::int16_t* window, std::ptrdiff_t stride, const std::int16_t* taps,
                  int size, std::int32_t* dots) {
    // Two blocks at a time: more would not fit the sixteen registers.
    constexpr int kBlocks = N >= 16 ? 2 : 1;
    for (int part = 0; part < N; part += 8 * kBlocks) {
      __m128i even[kBlocks], odd[kBlocks];
      for (int b = 0; b < kBlocks; ++b) even[b] = odd[b] = _mm_setzero_si128();
      for (int row = 0; row < size; ++row) {
        const std::int16_t* line = window + row * stride + part;
        const std::int16_t* row_taps = taps + row * (size + 1);
        for (int column = 0; column < size; column += 2) {
          const __m128i pair = _mm_set1_epi32(loadPair(row_taps + column));
          for (int b = 0; b < kBlocks; ++b) {
            const auto* at = reinterpret_cast<const __m128i*>(line + column + 8 * b);
            const auto* next = reinterpret_cast<const __m128i*>(line + column + 8 * b + 1);
            even[b] = _mm_add_epi32(even[b], _mm_madd_epi16(_mm_loadu_si128(at), pair));
            odd[b] = _mm_add_epi32(odd[b], _mm_madd_epi16(_mm_loadu_si128(next), pair));
          }
        }
      }
      for (int b = 0; b < kBlocks; ++b) {
        auto* out = reinterpret_cast<__m128i*>(dots + part + 8 * b);
        _mm_storeu_si128(out, _mm_unpacklo_epi32(even[b], odd[b]));
        _mm_storeu_si128(out + 1, _mm_unpackhi_epi32(even[b], odd[b]));
      }
    }
  }
  template <int N>
  static void divideByRoot(const float* products, const float* energies, float least,
                           float* scores) {
    const __m128 one = _mm_set1_ps(1.0f), minus_one = _mm_set1_ps(-1.0f);
    for (int i = 0; i < N; i += 4) {
      const __m128 energy = _mm_loadu_ps(energies + i);
      const __m128 textured = _mm_cmpge_ps(energy, _mm_set1_ps(least));
      const __m128 score = _mm_div_ps(_mm_loadu_ps(products + i), _mm_sqrt_ps(energy));
      _mm_storeu_ps(scores + i,
                    _mm_and_ps(textured, _mm_max_ps(_mm_min_ps(score, one), minus_one)));
    }
  }
};

}  // namespace
}  // namespace active_matching_slam
