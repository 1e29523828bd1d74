#pragma once

#include <Eigen/Core>
#include <cmath>

namespace active_matching_slam {

/// Whitens one image point: W S W^T = I with W = [a 0; b c], the inverse of the Cholesky factor.
struct Whitening {
  double a = 0.0, b = 0.0, c = 0.0;
  bool usable = false;  ///< the block is finite and positive definite; otherwise W = 0

  static Whitening of(double s00, double s10, double s11);
  static Whitening of(const Eigen::Matrix2d& S) { return of(S(0, 0), S(1, 0), S(1, 1)); }
  Eigen::Matrix2d matrix() const { return (Eigen::Matrix2d() << a, 0.0, b, c).finished(); }
};

/// The dependence of two points whose whitened cross covariance C has C C^T = [g00 g10; g10 g11]:
/// odds = |S_ii| |S_kk| / |S_(i,k)| - 1 = 1 / |I - C C^T| - 1, so that I = 1/2 log2(1 + odds).
/// It orders pairs as their information does, costs no logarithm, and keeps all its digits near
/// independence as well as near equality. 0 for what is not a covariance; bounded by
/// 2^(2 kMaximumPairBits).
inline double dependenceOdds(double g00, double g10, double g11) {
  constexpr double kSmallestRatio = 0x1p-100;
  constexpr double kRounding = 1e-9;
  const double lost = g00 + g11 - (g00 * g11 - g10 * g10);  // 1 - |I - C C^T|
  if (lost < 0.5) return lost > 0.0 ? lost / (1.0 - lost) : 0.0;
  const double m00 = 1.0 - g00, m11 = 1.0 - g11;
  const double ratio = m00 * m11 - g10 * g10;
  if (!(std::fmin(m00, m11) >= -kRounding && ratio >= -kRounding)) return 0.0;
  return 1.0 / std::fmax(ratio, kSmallestRatio) - 1.0;
}

/// The same from the cross covariance S_ik = [b00 b01; b10 b11] and both whitenings.
inline double dependenceOdds(const Whitening& i, const Whitening& k, double b00, double b10,
                             double b01, double b11) {
  const double x0 = i.a * b00, x1 = i.a * b01;                          // W_i S_ik, row 0
  const double y0 = i.b * b00 + i.c * b10, y1 = i.b * b01 + i.c * b11;  // row 1
  const double c00 = x0 * k.a, c01 = x0 * k.b + x1 * k.c;               // times W_k^T
  const double c10 = y0 * k.a, c11 = y0 * k.b + y1 * k.c;
  return dependenceOdds(c00 * c00 + c01 * c01, c00 * c10 + c01 * c11, c10 * c10 + c11 * c11);
}

/// 1/2 log2(1 + odds).
inline double oddsToBits(double odds) {
  constexpr double kHalfLog2E = 0.72134752044448170368;
  return kHalfLog2E * std::log1p(odds);
}

}  // namespace active_matching_slam
