#pragma once

// The parts that all correlation kernels have in common. In an anonymous namespace on purpose:
// every source file that includes this compiles them for its own instruction set.

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "correlation_kernels.h"

namespace active_matching_slam {
namespace {

inline void addRow(const std::int16_t* row, int count, std::int32_t* sums, std::int32_t* squares) {
  for (int u = 0; u < count; ++u) {
    // 16 bits without sign hold the square of a grey level; the multiplication stays narrow.
    const auto grey = static_cast<std::uint16_t>(row[u]);
    sums[u] += grey;
    squares[u] += static_cast<std::uint16_t>(grey * grey);
  }
}

inline void exchangeRow(const std::int16_t* row, const std::int16_t* gone, int count,
                        std::int32_t* sums, std::int32_t* squares) {
  for (int u = 0; u < count; ++u) {
    const auto grey = static_cast<std::uint16_t>(row[u]);
    const auto old = static_cast<std::uint16_t>(gone[u]);
    sums[u] += grey - old;
    squares[u] += static_cast<std::uint16_t>(grey * grey) - static_cast<std::uint16_t>(old * old);
  }
}

/// totals[i] = sum of `size` columns from the i-th on, of the numbers of a register at a time. Left
/// to the compiler, the loops are turned inside out.
template <class Vector, int N>
inline void sumColumns(const std::int32_t* columns, int size, std::int32_t* totals) {
  constexpr int kLanes = sizeof(Vector) / sizeof(std::int32_t), kVectors = N / kLanes;
  static_assert(kVectors * kLanes == N, "a block is a number of registers");
  Vector sums[kVectors] = {};
  for (int column = 0; column < size; ++column)
    for (int k = 0; k < kVectors; ++k) {
      Vector numbers;
      std::memcpy(&numbers, columns + column + k * kLanes, sizeof(numbers));
      sums[k] += numbers;
    }
  std::memcpy(totals, sums, sizeof(sums));
}

/// Scores `N` positions. Ops::Vector is a register
/// of 32-bit numbers, Ops::dot(window, stride, taps, size, dots) sums the products with the
/// taps, Ops::divideByRoot(products, energies, least, scores) does what it says.
template <class Ops, int N>
inline void scoreBlock(const KernelTemplate& t, const KernelRun& run, int first, float* scores) {
  alignas(32) std::int32_t dots[N], sums[N], squares[N];
  Ops::template dot<N>(run.window + first, run.stride, t.taps, t.size, dots);
  sumColumns<typename Ops::Vector, N>(run.sums + first, t.size, sums);
  sumColumns<typename Ops::Vector, N>(run.squares + first, t.size, squares);
  alignas(32) float products[N], energies[N];
  const double n = t.size * t.size;
  for (int i = 0; i < N; ++i) {
    // Integers below 2^53: exact until the conversion to float.
    const double sum = sums[i];
    products[i] = static_cast<float>((n * dots[i] - t.tap_sum * sum) * t.inverse_norm);
    energies[i] = static_cast<float>(n * squares[i] - sum * sum);
  }
  Ops::template divideByRoot<N>(products, energies, static_cast<float>(t.least_energy),
                                scores + first);
}

template <class Ops>
void scoreRun(const KernelTemplate& t, const KernelRun& run, float* scores) {
  int first = 0;
  for (; run.count - first > 16; first += 32) scoreBlock<Ops, 32>(t, run, first, scores);
  if (run.count - first > 8)
    scoreBlock<Ops, 16>(t, run, first, scores);
  else if (run.count > first)
    scoreBlock<Ops, 8>(t, run, first, scores);
}

}  // namespace
}  // namespace active_matching_slam
