#pragma once

#include <Eigen/Core>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/initialisation/keyframes.h"

namespace active_matching_slam {

/// The unit of length, which images leave open, fixed once: at the first commit the median depth
/// stays what it was; from then on the mean relative depth of the same features does, each by the
/// information that the first images held on it. Held by the same weights, the unit is the same
/// whatever is learnt of the depths meanwhile. When most of these features are gone, those of the
/// present hold it.
class ScaleGauge {
 public:
  /// Sets the scale of `hypothesis`; `filter` as it was before, and `information` of its
  /// depthInformation(). Returns the weights of its features in the gauge, of sum 1.
  Eigen::VectorXd apply(const Ekf& filter, const Eigen::VectorXd& information,
                        MotionHypothesis* hypothesis);
  void rescale(double factor);

 private:
  struct Reference {
    FeatureId id;
    double weight, inverse_depth;
  };
  std::vector<Reference> references_;  ///< ascending id
};

}  // namespace active_matching_slam
