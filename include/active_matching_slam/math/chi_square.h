#pragma once

namespace active_matching_slam {

/// The x with P(chi-square of 2 * `pairs` degrees of freedom <= x) = `probability`, pairs >= 1.
double chiSquareQuantile(int pairs, double probability);

}  // namespace active_matching_slam
