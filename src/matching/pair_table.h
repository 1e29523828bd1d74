#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace active_matching_slam {

/// A search in one Gaussian's ellipse as evidence for another Gaussian: its mass a inside, and the
/// factors of its weight after a search without and with a match (Chli 2009, eq. 5.13-5.17).
struct PairTerm {
  static constexpr double kUnknown = -1.0;
  double mass = kUnknown;
  double null = kUnknown;  ///< in a + 1 - a
  double null_log = 0.0;   ///< null * ln(null)
  double match = 0.0;      ///< match a + in (N - 1) a + N (1 - a)
  double match_log = 0.0;  ///< match * ln(match)
};

/// The marginals of one feature that are alive in the mixture, and the terms of all pairs of them.
/// Gaussians whose marginals are the same, since all have fused one match, or since a tree's
/// measurement has not touched the feature, share one entry. Only kMost are remembered, so that a
/// crowded mixture has bounded memory.
class PairTable {
 public:
  static constexpr int kMost = 64;
  static constexpr int kNone = -1;

  /// An entry with one user and no terms; kNone when all are taken.
  int acquire();
  /// kNone is allowed in both.
  void retain(int entry) {
    if (entry != kNone) ++users_[static_cast<std::size_t>(entry)];
  }
  void release(int entry) {
    if (entry != kNone) --users_[static_cast<std::size_t>(entry)];
  }
  /// Distinguishes an entry in use from a later one in its place; 0 when it has no user.
  std::int64_t serial(int entry) const {
    return users_[static_cast<std::size_t>(entry)] > 0 ? serials_[static_cast<std::size_t>(entry)]
                                                       : 0;
  }
  /// A search of the ellipse of `searcher` as evidence for `other`.
  PairTerm& term(int other, int searcher) {
    return terms_[static_cast<std::size_t>(searcher) * stride_ + static_cast<std::size_t>(other)];
  }
  /// The same for the searcher itself, to which a match adds nothing (it goes to the child).
  PairTerm& own(int searcher) { return own_[static_cast<std::size_t>(searcher)]; }

 private:
  void grow();

  std::vector<int> users_;
  std::vector<std::int64_t> serials_;
  std::int64_t last_serial_ = 0;
  std::vector<PairTerm> own_;
  std::size_t stride_ = 0;
  std::vector<PairTerm> terms_;  // [searcher][other], stride_ square
};

}  // namespace active_matching_slam
