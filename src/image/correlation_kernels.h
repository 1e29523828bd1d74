#pragma once

#include <cstddef>
#include <cstdint>

namespace active_matching_slam {

/// What the score of a position is made of, but for the image. See Correlator.
struct KernelTemplate {
  int size = 0;               ///< odd
  const std::int16_t* taps;   ///< `size` rows of size + 1 numbers, the last of each zero
  double tap_sum = 0.0;       ///< of all taps
  double inverse_norm = 0.0;  ///< 1 / sqrt(n sum tap^2 - (sum tap)^2)
  double least_energy = 1.0;  ///< windows of less n sum I^2 - (sum I)^2 score 0
};

/// The image around a run of positions.
struct KernelRun {
  const std::int16_t* window;   ///< top left of the template at the first position
  std::ptrdiff_t stride = 0;    ///< from row to row of the window
  const std::int32_t* sums;     ///< of each column of the template's height, from the first on
  const std::int32_t* squares;  ///< of the squares likewise
  int count = 0;                ///< positions
};

/// Rows of the window and both sums are readable for this many numbers beyond the last that counts,
/// and the scores are writable likewise.
constexpr int kKernelOverrun = 32;

/// Functions of one instruction set. All give the same bits: sums are exact integers, and what
/// follows is elementwise IEEE arithmetic.
struct CorrelationKernels {
  void (*scoreRun)(const KernelTemplate&, const KernelRun&, float* scores);
  /// Adds a row and its squares to the sums of columns.
  void (*addRow)(const std::int16_t* row, int count, std::int32_t* sums, std::int32_t* squares);
  /// Adds `row` and takes `gone` away.
  void (*exchangeRow)(const std::int16_t* row, const std::int16_t* gone, int count,
                      std::int32_t* sums, std::int32_t* squares);
};

const CorrelationKernels& portableKernels();
/// Null when they are not for this processor.
const CorrelationKernels* sse2Kernels();
const CorrelationKernels* avx2Kernels();

}  // namespace active_matching_slam
