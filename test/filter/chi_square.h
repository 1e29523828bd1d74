#pragma once

#include <cmath>
#include <utility>

namespace active_matching_slam {

/// 95 % bounds of the mean of `runs` chi-square variables of `degrees` (Wilson & Hilferty 1931).
inline std::pair<double, double> meanChiSquareBounds(int runs, int degrees) {
  const double k = static_cast<double>(runs) * degrees;
  const auto quantile = [k](double z) {
    const double root = 1.0 - 2.0 / (9.0 * k) + z * std::sqrt(2.0 / (9.0 * k));
    return k * root * root * root;
  };
  return {quantile(-1.959964) / runs, quantile(1.959964) / runs};
}

/// Expectation of f(x) for a chi-square x of 2 degrees, of density exp(-x / 2) / 2. By Simpson's
/// rule.
template <typename Function>
double chiSquareExpectation(const Function& f) {
  constexpr int kSteps = 20000;  // even
  constexpr double kStep = 0.01;
  double sum = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = i * kStep, weight = i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
    sum += weight * f(x) * 0.5 * std::exp(-0.5 * x);
  }
  return sum * kStep / 3.0;
}

/// What the M-estimation of a mean by weights of the bivariate t distribution makes of errors that
/// are Gaussian after all, by the theory of Huber (1981).
struct TailModel {
  double degrees = 4.0;  ///< of freedom of the t distribution (Lange, Little & Taylor 1989)

  double weight(double chi2) const { return (degrees + 2.0) / (degrees + chi2); }
  /// Variance of the estimate over what the weights claim, which is 1 / E[w].
  double varianceFactor() const {
    const auto slope = [this](double x) { return -weight(x) / (degrees + x); };
    const double spread =
        chiSquareExpectation([&](double x) { return 0.5 * weight(x) * weight(x) * x; });
    const double gain = chiSquareExpectation([&](double x) { return weight(x) + x * slope(x); });
    return spread / (gain * gain) * chiSquareExpectation([&](double x) { return weight(x); });
  }
  /// Mean weighted square of an error per degree of freedom.
  double weightedSquare() const {
    return 0.5 * chiSquareExpectation([this](double x) { return weight(x) * x; });
  }
};

}  // namespace active_matching_slam
