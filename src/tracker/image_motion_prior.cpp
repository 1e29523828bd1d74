#include "active_matching_slam/tracker/image_motion_prior.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/innovation_gate.h"

namespace active_matching_slam {
namespace {

/// Standard deviation of the image's motion for the mean of the features' motions, in the standard
/// deviation of these: what fills most of the image moves its alignment more than the mean.
/// Derivation: where half of the image moves by one motion and half by another, the alignment takes
/// either, each one standard deviation off the mean; half of that is between this and none.
constexpr double kSpreadFraction = 0.5;
constexpr double kFlowGateChi2 = 13.8;  ///< Standard: chi-square, 99.9 % of 2 degrees of freedom

}  // namespace

ImageMotion predictedImageMotion(const MeasurementPrior& prior,
                                 const std::vector<std::optional<Eigen::Vector2d>>& before_px) {
  ImageMotion motion;
  int count = 0;
  for (int i = 0; i < prior.size(); ++i) {
    if (!before_px[i]) continue;
    motion.shift_px += prior.mean(i) - *before_px[i];
    ++count;
  }
  if (count > 0) motion.shift_px /= count;
  return motion;
}

MeasurementPrior conditionOnImageMotion(
    const MeasurementPrior& prior, const std::vector<std::optional<Eigen::Vector2d>>& before_px,
    const ImageMotion& motion) {
  std::vector<int> visible;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (int i = 0; i < prior.size(); ++i) {
    if (!before_px[i]) continue;
    visible.push_back(i);
    centre += prior.mean(i);
  }
  const auto n = static_cast<double>(visible.size());
  if (visible.size() < 3) return prior;
  centre /= n;
  double squared_radius = 0.0;  // mean
  for (const int i : visible) squared_radius += (prior.mean(i) - centre).squaredNorm() / n;
  const double radius = std::sqrt(squared_radius);
  if (!(radius > 0.0)) return prior;

  // Rows of A: shift u, shift v, turn times radius. The columns of B are what they do to a point.
  Eigen::Matrix3Xd A = Eigen::Matrix3Xd::Zero(3, prior.z.size());
  Eigen::VectorXd off = Eigen::VectorXd::Zero(prior.z.size());
  for (const int i : visible) {
    const Eigen::Vector2d arm = (prior.mean(i) - centre) / radius;
    Eigen::Matrix<double, 2, 3> B;
    B << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    A.middleCols<2>(2 * i) = B.transpose() / n;
    off.segment<2>(2 * i) = motion(*before_px[i]) - prior.mean(i);
  }
  const Eigen::Vector3d common = A * off;
  const double spread = (off - n * A.transpose() * common).squaredNorm() / (2.0 * n);
  const double variance =
      motion.sigma_px * motion.sigma_px + kSpreadFraction * kSpreadFraction * spread;

  Eigen::MatrixXd P = prior.S;  // without the noise of a match
  for (int i = 0; i < prior.size(); ++i)
    P.diagonal().segment<2>(2 * i).array() -= prior.noiseVariance_px2(i);
  const Eigen::MatrixX3d PA = P * A.transpose();
  const Eigen::Matrix3d V = A * PA, noise = variance * Eigen::Matrix3d::Identity();
  MeasurementPrior conditioned = prior;
  const Eigen::LLT<Eigen::Matrix3d> common_motion(V), expected(V + noise);
  if (common_motion.info() != Eigen::Success || expected.info() != Eigen::Success)
    return conditioned;
  // f V for V: P <- P + (f - 1) P A^T V^-1 A P, which leaves what is not common as it is.
  const double f = std::max(1.0, common.dot(expected.solve(common)) / 3.0);
  const Eigen::Matrix3Xd widened =
      std::sqrt(f - 1.0) * common_motion.matrixL().solve(PA.transpose());
  conditioned.S += widened.transpose() * widened;

  const Eigen::LLT<Eigen::Matrix3d> measured(f * V + noise);
  conditioned.z += f * PA * measured.solve(common);
  const Eigen::Matrix3Xd root = f * measured.matrixL().solve(PA.transpose());
  conditioned.S -= root.transpose() * root;
  return conditioned;
}

std::optional<MeasurementPrior> conditionOnFlow(
    const MeasurementPrior& prior, const std::vector<std::optional<Eigen::Vector2d>>& flow_px,
    double sigma_px) {
  std::vector<int> tracked;
  for (int i = 0; i < prior.size(); ++i)
    if (flow_px[i]) tracked.push_back(i);
  Eigen::VectorXd innovation(2 * static_cast<int>(tracked.size()));
  for (std::size_t k = 0; k < tracked.size(); ++k)
    innovation.segment<2>(2 * k) = *flow_px[tracked[k]] - prior.mean(tracked[k]);
  Eigen::MatrixXd S = selectFeatures(prior.S, tracked);
  for (std::size_t k = 0; k < tracked.size(); ++k)
    S.diagonal().segment<2>(2 * k).array() +=
        sigma_px * sigma_px - prior.noiseVariance_px2(tracked[k]);
  const std::vector<int> kept = leaveOneOutInliers(innovation, S, kFlowGateChi2);
  if (2 * static_cast<int>(kept.size()) <= prior.size()) return std::nullopt;

  const int n = 2 * static_cast<int>(kept.size());
  Eigen::MatrixXd PA(prior.S.rows(), n);
  Eigen::VectorXd kept_innovation(n);
  for (int k = 0; k < n / 2; ++k) {
    const int i = tracked[kept[k]];
    PA.middleCols<2>(2 * k) = prior.S.middleCols<2>(2 * i);
    PA.block<2, 2>(2 * i, 2 * k).diagonal().array() -= prior.noiseVariance_px2(i);
    kept_innovation.segment<2>(2 * k) = innovation.segment<2>(2 * kept[k]);
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(selectFeatures(S, kept));
  if (factor.info() != Eigen::Success) return std::nullopt;
  MeasurementPrior conditioned = prior;
  conditioned.z += PA * factor.solve(kept_innovation);
  const Eigen::MatrixXd root = factor.matrixL().solve(PA.transpose());
  conditioned.S -= root.transpose() * root;
  return conditioned;
}

}  // namespace active_matching_slam
