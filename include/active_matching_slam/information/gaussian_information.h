#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace active_matching_slam {

/// Information in Gaussians (Chli 2009, chapter 4). Every value is in bits, every covariance is
/// symmetric. `S` is the 2F x 2F joint covariance of F image points, u0 v0 u1 v1 ... [px^2].
///
/// Bad numbers never throw here: a feature is *usable* when its own 2 x 2 block is finite and
/// positive definite. What is not usable has 0 bits with everything, as if it were independent.
/// A wrong size or index is a fault of the caller and throws std::invalid_argument.

/// Features that determine each other exactly share infinitely many bits; pairs stop at this many.
constexpr double kMaximumPairBits = 50.0;

/// Joint covariance of some features alone; `features` are indices into S, ascending.
Eigen::MatrixXd selectFeatures(const Eigen::Ref<const Eigen::MatrixXd>& S,
                               const std::vector<int>& features);

/// Entropy of a Gaussian, 1/2 log2((2 pi e)^n |P|) (eq. 4.10). Empty when P is not finite or not
/// positive definite. 0 for n = 0.
std::optional<double> entropyBits(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

/// I(a;b) of the variables `part` and all the others, 1/2 log2(|P_aa| |P_bb| / |P|) (eq. 4.25).
/// Empty when P is not finite or not positive definite; 0 when either side has no variables.
/// Throws when an index is out of range or given twice.
std::optional<double> partitionInformationBits(const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                                               const std::vector<int>& part);

/// I(x; z_i) of a state x and every image point z_i (eq. 4.28): F values.
/// `state_covariance` n x n, `cross_covariance` n x 2F. All 0 when the state's covariance is not
/// finite or not positive definite.
Eigen::VectorXd stateInformationBits(const Eigen::Ref<const Eigen::MatrixXd>& state_covariance,
                                     const Eigen::Ref<const Eigen::MatrixXd>& cross_covariance,
                                     const Eigen::Ref<const Eigen::MatrixXd>& S);

/// What active matching asks of S: the information of each feature about all others.
struct FeatureInformation {
  Eigen::VectorXd bits;                   ///< F, I(z_i; all others) (eq. 4.31)
  Eigen::VectorXd precision_determinant;  ///< F, |L_ii| with L = S^-1; 0 where not usable
  std::vector<char> usable;               ///< F
  /// S was not positive definite: S + regularisation * diag(S) was used in its place, the least of
  /// 1e-12, 1e-10, ... 1 that is. When none is, no feature is usable.
  double regularisation = 0.0;
};

/// One factorisation for all features: |S_rest| / |S| = |L_ii| (Schur complement), so
/// I = 1/2 log2(|S_ii| |L_ii|). Conditioning on measured features deletes their rows and columns of
/// L and changes nothing else: |L_ii| stays valid for every later conditional covariance. O(F^3).
FeatureInformation featureInformation(const Eigen::Ref<const Eigen::MatrixXd>& S);

/// 1/2 log2(|S_ii| |L_ii|), never negative: the information of a feature whose marginal has shrunk
/// to S_ii while |L_ii| is constant. 0 when either determinant is not positive.
double informationBits(double covariance_determinant, double precision_determinant);

/// I(z_i; z_k) = 1/2 log2(|S_ii| |S_kk| / |S_(i,k)|) (eq. 4.35). 0 for i == k.
double pairInformationBits(const Eigen::Ref<const Eigen::MatrixXd>& S, int i, int k);

/// I(z_i; z_k) of all pairs: F x F, symmetric, 0 on the diagonal. O(F^2), closed form.
Eigen::MatrixXd pairInformationMatrix(const Eigen::Ref<const Eigen::MatrixXd>& S);

/// Area of the 3-sigma ellipse, 9 pi sqrt|S_ii| [px^2]. 0 when S_ii is not positive definite.
double ellipseArea(const Eigen::Matrix2d& covariance);

/// Bits per pixel to be searched (eq. 4.30). 0 for an empty ellipse.
double informationEfficiency(double bits, double area_px);

}  // namespace active_matching_slam
