#pragma once

namespace active_matching_slam {

/// The x with P(chi-square of `degrees` degrees of freedom <= x) = `probability`. Throws
/// std::domain_error unless degrees > 0 and 0 <= probability < 1.
double chiSquareQuantile(double degrees, double probability);

}  // namespace active_matching_slam
