#pragma once

#include <Eigen/Core>
#include <vector>

namespace active_matching_slam {

/// What a map loses when it is cut in two: J on one side, R on the other, and between them a
/// separator C, given which the two are taken for independent (a junction tree of Gaussians: Paskin
/// 2003). All sets are rows of a joint covariance P; bits are those of Gaussians.

/// I(J; R | C) = 1/2 log2(|P_J|C| |P_R|C| / |P_JR|C|) [bit], never negative. The sets are disjoint.
double separatedInformation(const Eigen::Ref<const Eigen::MatrixXd>& P, const std::vector<int>& J,
                            const std::vector<int>& R, const std::vector<int>& C);

/// Rows of P among which a separator is chosen. Points have three rows and are named by their
/// first.
struct SeparatorCandidates {
  std::vector<int> given;    ///< rows in every separator (the calibration); all else is given them
  std::vector<int> inside;   ///< points of J
  std::vector<int> outside;  ///< points of R that may be chosen
  std::vector<int> others;   ///< rows of R that may not: the camera, rays
  std::vector<int> preferred;  ///< points that are separators already: of `inside` or `outside`
};

struct SeparatorLimits {
  int maximum_points = 10;
  double enough_bits = 1.0;  ///< so little may be lost: no more points are chosen
  /// A preferred point is chosen if it tells at most so much less than the best [bit].
  double preference_bits = 0.5;
};

struct Separator {
  std::vector<int> points;   ///< first rows, in the order in which they were chosen
  std::vector<double> bits;  ///< I(J; R | C) with none, one, two ... of them: points + 1
};

/// Chooses a separator greedily. As I(J; R | C) = I(i; other side | C) + I(rest; other side | C, i)
/// for i on either side, the next point is the one that knows most of the other side. Two
/// factorisations at the start; then a partial Cholesky decomposition, pivoted by information, of
/// P and of both conditional covariances: O(n |C|) a step. Fewer points than allowed where there
/// are no more.
Separator chooseSeparator(const Eigen::Ref<const Eigen::MatrixXd>& P,
                          const SeparatorCandidates& candidates, const SeparatorLimits& limits);

/// Two sides of a cut, given the separator.
struct GivenSeparator {
  Eigen::MatrixXd inside;   ///< cov(J | C)
  Eigen::MatrixXd outside;  ///< cov(R | C)
  Eigen::MatrixXd across;   ///< cov(J, R | C)
};
GivenSeparator givenSeparator(const Eigen::Ref<const Eigen::MatrixXd>& P, const std::vector<int>& J,
                              const std::vector<int>& R, const std::vector<int>& C);

/// What is to be added to both sides when the link between them is dropped.
struct ConservativeCut {
  Eigen::MatrixXd inside;     ///< to cov(J | C), positive semi-definite
  Eigen::MatrixXd outside;    ///< to cov(R | C), likewise
  Eigen::MatrixXd explained;  ///< of cov(J | C), what R knows: X D^-1 X^T
};

/// Cuts J from R, given the covariances under condition of the separator: A = cov(J | C),
/// D = cov(R | C), X = cov(J, R | C). With A = L_A L_A^T, D = L_D L_D^T and the canonical
/// correlations L_A^-1 X L_D^-T = U diag(rho) V^T it adds L_A U diag(rho) U^T L_A^T and
/// L_D V diag(rho) V^T L_D^T: as [rho -rho; -rho rho] >= 0, the covariance of both without the link
/// is then not less than with it, in any direction, and no measurement counts twice.
ConservativeCut conservativeCut(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                const Eigen::Ref<const Eigen::MatrixXd>& D,
                                const Eigen::Ref<const Eigen::MatrixXd>& X);

/// Of a variable with covariance A, what is told by something that explains so much of it,
/// 1/2 log2(|A| / |A - explained|) [bit]; for several that are independent, the sum of `explained`.
double explainedInformation(const Eigen::Ref<const Eigen::MatrixXd>& A,
                            const Eigen::Ref<const Eigen::MatrixXd>& explained);

}  // namespace active_matching_slam
