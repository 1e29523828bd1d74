#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// How many sets of as many matches would agree as closely by accident, as its decimal logarithm:
/// the number of false alarms of a consensus (Desolneux, Moisan & Morel 2000; for correspondences
/// Moisan & Stival 2004). Far below 0 the set is no accident. Above, it may well be one: in a
/// blurred image, which shows hardly any feature as it was, what little matches is something else.
///
/// Three matches fix a camera. Of each further feature the others leave a share of its gate: the
/// root of the ratio of the determinants of its covariance after and before. An accidental match is
/// in there with the chance of that share, one of several matches with accordingly more. The
/// product of those chances, once for each choice of three matches and of that many features.
///
/// `S`: 2n x 2n joint covariance of the predictions [px^2]; `matches`: how many each of the n
/// features has; `accepted`: the features of the set, ascending, each with a match. Infinite for
/// three matches and less, and when S is not positive definite.
double logFalseAlarms(const Eigen::MatrixXd& S, const std::vector<int>& matches,
                      const std::vector<int>& accepted);

}  // namespace active_matching_slam
