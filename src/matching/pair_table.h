#pragma once

#include <cstddef>
#include <vector>

namespace active_matching_slam {

/// How a search in one Gaussian's ellipse looks from another Gaussian k: its mass a inside, and the
/// factors that a search without and with a match gives k's weight (Chli 2009, eq. 5.13-5.17).
struct PairTerm {
  static constexpr double kUnknown = -1.0;
  double mass = kUnknown;
  double null = kUnknown;  ///< in a + 1 - a
  double null_log = 0.0;   ///< null * ln(null)
  double match = 0.0;      ///< [k != g] match a + in (N - 1) a + N (1 - a)
  double match_log = 0.0;  ///< match * ln(match)
};

/// The terms of all pairs (k, g) of Gaussians, for the features that can be searched in g. A
/// marginal never changes while its Gaussian lives, so each is computed once; with their logarithms
/// kept too, a prediction needs none for each Gaussian. Only kSlots Gaussians are remembered, so
/// that a crowded mixture has bounded memory.
class PairTable {
 public:
  static constexpr int kSlots = 64;
  /// Terms by candidate of g; empty while all are unknown.
  using Row = std::vector<PairTerm>;

  /// A free slot, all unknown; -1 when there is none.
  int acquire();
  void release(int slot);
  bool isUsed(int slot) const { return used_[static_cast<std::size_t>(slot)] != 0; }
  /// Both slots valid.
  Row& row(int k, int g) { return rows_[static_cast<std::size_t>(g)][static_cast<std::size_t>(k)]; }

 private:
  std::vector<char> used_;
  std::vector<std::vector<Row>> rows_;  // [g][k], square
};

}  // namespace active_matching_slam
