#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// A-contrario test: decimal logarithm of the number of false alarms (NFA) of a consensus, the
/// expected number of sets of as many matches that agree as closely by chance (Desolneux, Moisan &
/// Morel 2000; for correspondences Moisan & Stival 2004). Far below 0 the consensus is significant;
/// above, it may be accidental, as in a blurred image where most matches are outliers.
///
/// Three matches fix a camera. Conditioned on the others, each further feature's gate shrinks to a
/// fraction of its area: the root of the ratio of the determinants of its covariance after and
/// before. An accidental match lies in it with that probability, one of several matches with
/// accordingly more. The number of false alarms is the product of these probabilities times the
/// number of tests: choices of three matches and of as many features.
///
/// `S`: 2n x 2n joint covariance of the predictions [px^2]; `matches`: how many each of the n
/// features has; `accepted`: the features of the set, ascending, each with a match. Infinite for
/// three matches and less, and when S is not positive definite.
double logFalseAlarms(const Eigen::MatrixXd& S, const std::vector<int>& matches,
                      const std::vector<int>& accepted);

}  // namespace active_matching_slam
