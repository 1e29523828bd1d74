#include "match_replay.h"

#include <Eigen/LU>
#include <cmath>

#include "active_matching_slam/visualisation/debug_canvas.h"

namespace active_matching_slam {

void JointPoints::condition(int feature, const Eigen::Vector2d& pixel) {
  const Eigen::MatrixXd column = S.middleCols<2>(2 * feature);
  const Eigen::MatrixXd gain = column * covariance(feature).inverse();
  z += gain * (pixel - mean(feature));
  S -= gain * column.transpose();
  S = (0.5 * (S + S.transpose())).eval();
  z.segment<2>(2 * feature) = pixel;
  S.middleCols<2>(2 * feature).setZero();
  S.middleRows<2>(2 * feature).setZero();
}

double meanShrinkBits(const JointPoints& before, const JointPoints& after,
                      const std::vector<int>& features) {
  double bits = 0.0;
  for (const int i : features)
    bits += 0.5 * std::log2(before.covariance(i).determinant() / after.covariance(i).determinant());
  return features.empty() ? 0.0 : bits / static_cast<double>(features.size());
}

MatchReplay::MatchReplay(const MatchingTrial& trial) {
  int next = trial.result.trace.empty() ? 0 : trial.result.trace.front().gaussian;
  accepted_ = first_ = next;
  matches_[next++];  // children are numbered on, each search's in the order of its matches
  for (const MatchStep& step : trial.result.trace) {
    for (const int m : step.spawned) {
      std::vector<Match> matches = matches_[step.gaussian];
      matches.push_back(
          {step.feature,
           trial.matches[static_cast<std::size_t>(step.feature)][static_cast<std::size_t>(m)]
               .pixel});
      matches_[next++] = std::move(matches);
    }
  }
  if (!trial.result.hypotheses.empty()) accepted_ = trial.result.hypotheses.front().gaussian;
}

void drawJoint(const JointPoints& joint, const cv::Scalar& color, DebugCanvas* canvas) {
  for (int i = 0; 2 * i < joint.z.size(); ++i) {
    const Eigen::Matrix2d covariance = joint.covariance(i);
    if (covariance.determinant() > 0.0)
      canvas->ellipse(joint.mean(i), covariance, color);
    else
      canvas->dot(joint.mean(i), 3.0, color);
  }
}

cv::Mat captioned(const cv::Mat& picture, double unit, const std::string& caption) {
  return withFooter(picture, unit, caption, cv::Scalar::all(235), {});
}

}  // namespace active_matching_slam
