#pragma once

namespace active_matching_slam {

/// Relative standard deviation up to which a scale is taken from what stands about: a target, the
/// ground. Derivation: the logarithm of a length is taken to first order; what that leaves out is
/// half the square, 0.5 %.
constexpr double kLargestScaleSigma = 0.1;

}  // namespace active_matching_slam
