#pragma once

#include <cstdint>

namespace active_matching_slam {

/// Small seeded generator (SplitMix64). The distributions of the standard library differ between
/// implementations; these do not, so a seed means the same sequence everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15ull;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  /// In [0, 1).
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
  /// In [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// In [low, high], both included.
  int integer(int low, int high) {
    return low + static_cast<int>(next() % static_cast<std::uint64_t>(high - low + 1));
  }
  /// -1 or 1.
  double sign() { return (next() >> 63) != 0 ? 1.0 : -1.0; }
  /// A generator of its own for a part that is numbered.
  Random fork(std::uint64_t part) const {
    return Random(Random(state_ ^ (part + 1) * 0xD1342543DE82EF95ull).next());
  }

 private:
  std::uint64_t state_;
};

}  // namespace active_matching_slam
