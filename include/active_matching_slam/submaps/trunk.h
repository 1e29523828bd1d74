#pragma once

#include <vector>

#include "active_matching_slam/submaps/conditional.h"

namespace active_matching_slam {

/// Points S that have left the active map M: the Gaussian p(x_S | x_M), dense and exact but for
/// what something else than M (the moving camera, rays) alone knew of them. It is touched only when
/// points come or go, never by a measurement (compressed filter: Guivant & Nebot 2001, written as a
/// conditional).
///
/// `active` is always M as the filter has it: all its points, S's separate. Points of M that the
/// trunk was not told of are new: nothing of S depends on them. Points that leave M must leave by
/// take() or marginalise(), before the filter removes them.
class Trunk {
 public:
  /// S in order; given_ids: points of M on which it depends.
  const Conditional& conditional() const { return conditional_; }
  const std::vector<FeatureId>& ids() const { return conditional_.ids; }
  bool empty() const { return conditional_.ids.empty(); }

  void clear() { conditional_ = {}; }
  /// A saved conditional.
  void restore(const Conditional& conditional) { conditional_ = conditional; }

  /// The means of now: m <- m + K (x_M - c), c <- x_M. Every operation begins with it.
  void refresh(const PointGaussian& active);

  /// Some of S given M as it is now.
  Conditional givenActive(const PointGaussian& active, const std::vector<FeatureId>& ids) const;

  /// M -> S. With T the points `ids`, A = M \ T, G = P_TA P_AA^-1, Q_T = P_TT - G P_AT:
  ///   K <- [K_A + K_T G; G],  Q <- [Q + K_T Q_T K_T^T, K_T Q_T; Q_T K_T^T, Q_T].
  /// The filter removes them afterwards.
  void take(const PointGaussian& active, const std::vector<FeatureId>& ids);

  /// S -> M: the points `ids` given M, to be inserted into the filter. Of the rest O it keeps, with
  /// B = Q_OT Q_TT^-1:  K_O <- [K_O - B K_T, B],  Q_O <- Q_OO - B Q_TO.
  Conditional give(const PointGaussian& active, const std::vector<FeatureId>& ids);

  /// Points of M that the filter will remove for good: S keeps what it knew of the others through
  /// them.
  void marginalise(const PointGaussian& active, const std::vector<FeatureId>& ids);

  /// Whether S tells of this point of M. If not, it may leave at no cost.
  bool dependsOn(FeatureId id) const;

  /// Leaves out points of S.
  void forget(const std::vector<FeatureId>& ids);

  /// The joint Gaussian of M and these points of S.
  PointGaussian joint(const PointGaussian& active, const std::vector<FeatureId>& ids) const;

  /// Adds to Q, in the order of ids().
  void inflate(const Eigen::MatrixXd& added);

  /// All lengths times `factor` > 0, as the filter has.
  void rescale(double factor) { conditional_.rescale(factor); }

 private:
  Conditional conditional_;
};

}  // namespace active_matching_slam
