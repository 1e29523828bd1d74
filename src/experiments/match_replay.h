#pragma once

#include <map>
#include <utility>
#include <vector>

#include "active_matching_slam/matching/measurement_prior.h"
#include "matching_trial.h"

namespace active_matching_slam {

class DebugCanvas;

/// A joint Gaussian of image points.
struct JointPoints {
  Eigen::VectorXd z;  ///< 2F [px]
  Eigen::MatrixXd S;  ///< 2F x 2F [px^2]

  Eigen::Vector2d mean(int feature) const { return z.segment<2>(2 * feature); }
  Eigen::Matrix2d covariance(int feature) const { return S.block<2, 2>(2 * feature, 2 * feature); }
  /// Given that the feature is at `pixel`; its own covariance becomes 0.
  void condition(int feature, const Eigen::Vector2d& pixel);
};

/// Mean over these features of 1/2 log2(|S_ii| before / |S_ii| after) [bit]: a bit halves the area
/// of an ellipse.
double meanShrinkBits(const JointPoints& before, const JointPoints& after,
                      const std::vector<int>& features);

/// What a matcher did in a frame, step by step, from the trace of its trial.
class MatchReplay {
 public:
  struct Match {
    int feature;
    Eigen::Vector2d pixel;
  };

  explicit MatchReplay(const MatchingTrial& trial);

  /// What a Gaussian is conditioned on, in this order; of the prior nothing.
  const std::vector<Match>& matchesOf(int gaussian) const { return matches_.at(gaussian); }
  /// The one that the trial accepted.
  int accepted() const { return accepted_; }
  int prior() const { return first_; }

 private:
  std::map<int, std::vector<Match>> matches_;
  int first_ = 0, accepted_ = 0;
};

/// Ellipses of the features that are not matched yet, and dots for those that are.
void drawJoint(const JointPoints& joint, const cv::Scalar& color, DebugCanvas* canvas);

/// The picture with a line of text below it.
cv::Mat captioned(const cv::Mat& picture, double unit, const std::string& caption);

}  // namespace active_matching_slam
