#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

namespace active_matching_slam {

/// One feature's marginal in a joint Gaussian.
struct Marginal {
  Eigen::Matrix2d covariance;  ///< [px^2]; R for a measured feature
  double determinant = 0.0;    ///< 0: not a proper Gaussian, the feature cannot be searched
  /// I(z_f; all features not measured), 1/2 log2(|S_ff| |L_ff|) with the L_ff of the prior, which
  /// conditioning never changes.
  double information_bits = 0.0;
};

/// The joint covariance given that some features are measured. It depends on which, not on where
/// (siblings in a mixture share it). Immutable, apart from the list of what was derived from it.
class ConditionalJoint {
 public:
  virtual ~ConditionalJoint() = default;

  const Marginal& marginal(int feature) const {
    return marginals_[static_cast<std::size_t>(feature)];
  }
  bool isMeasured(int feature) const { return measured_[static_cast<std::size_t>(feature)] != 0; }
  /// The features whose marginal differs from that of the conditional this was derived from, the
  /// one just measured not included, ascending in the dense case.
  const std::vector<int>& touched() const { return touched_; }
  /// How the means of touched()[i] move with a measurement at `innovation` from the expected place:
  /// cross(i) * S_cc^-1 * innovation, c the feature just measured, covariances before.
  const Eigen::Matrix2d& cross(std::size_t i) const { return cross_[i]; }
  const Eigen::Matrix2d& measuredPrecision() const { return measured_precision_; }

 protected:
  friend class Joint;
  std::vector<Marginal> marginals_;
  std::vector<char> measured_;
  std::vector<int> touched_;
  std::vector<Eigen::Matrix2d> cross_;
  Eigen::Matrix2d measured_precision_ = Eigen::Matrix2d::Zero();
  mutable std::vector<std::pair<int, std::weak_ptr<const ConditionalJoint>>> derived_;
};

/// A joint Gaussian of image points that can be conditioned: all that Active Matching's mixture
/// needs to know of it. Dense, or a tree of marginals and edges.
class Joint {
 public:
  virtual ~Joint() = default;

  int size() const { return static_cast<int>(precision_determinant_.size()); }
  const std::shared_ptr<const ConditionalJoint>& prior() const { return prior_; }
  /// `given` with one more feature measured (proper, not measured yet).
  std::shared_ptr<const ConditionalJoint> measure(
      const std::shared_ptr<const ConditionalJoint>& given, int feature) const;

 protected:
  /// `noise_variances`: F, of R, the marginal of a measured feature. `precision_determinant`: F,
  /// |L_ff|.
  Joint(Eigen::VectorXd noise_variances, Eigen::VectorXd precision_determinant);
  virtual std::shared_ptr<ConditionalJoint> derive(
      const std::shared_ptr<const ConditionalJoint>& given, int feature) const = 0;
  /// Sets a marginal with all that follows from it.
  void setMarginal(ConditionalJoint& conditional, int feature,
                   const Eigen::Matrix2d& covariance) const;
  /// Copies marginals and flags of `given` and marks `feature` as measured.
  void inherit(ConditionalJoint& conditional, const ConditionalJoint& given, int feature) const;
  void setPrior(std::shared_ptr<ConditionalJoint> prior) { prior_ = std::move(prior); }

  static std::vector<Marginal>& marginalsOf(ConditionalJoint& c) { return c.marginals_; }
  static std::vector<char>& measuredOf(ConditionalJoint& c) { return c.measured_; }
  static std::vector<int>& touchedOf(ConditionalJoint& c) { return c.touched_; }
  static std::vector<Eigen::Matrix2d>& crossOf(ConditionalJoint& c) { return c.cross_; }

 private:
  Eigen::VectorXd noise_variances_;
  Eigen::VectorXd precision_determinant_;
  std::shared_ptr<const ConditionalJoint> prior_;
};

/// The full covariance. A measurement is one step of an incremental, left-looking Cholesky:
/// O(F) for each feature measured before.
std::unique_ptr<Joint> makeDenseJoint(const Eigen::MatrixXd& S,
                                      const Eigen::VectorXd& precision_determinant,
                                      const Eigen::VectorXd& noise_variances);

struct ChowLiuTree;

/// A tree (or forest) of marginals and edge blocks; belief propagation outwards from the measured
/// node, whose edges are then cut. (Chli 2009, eq. 7.19-7.25)
std::unique_ptr<Joint> makeTreeJoint(const ChowLiuTree& tree,
                                     const Eigen::VectorXd& noise_variances);

}  // namespace active_matching_slam
