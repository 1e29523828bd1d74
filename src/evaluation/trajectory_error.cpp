#include "active_matching_slam/evaluation/trajectory_error.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace active_matching_slam {
namespace {

/// Whether the positions have a variance beyond rounding.
bool moves(const Eigen::Matrix3Xd& positions) {
  const Eigen::Vector3d mean = positions.rowwise().mean();
  const double variance =
      (positions.colwise() - mean).squaredNorm() / static_cast<double>(positions.cols());
  return variance > 1e-24 * (1.0 + mean.squaredNorm());
}

}  // namespace

Eigen::Isometry3d Alignment::operator()(const Eigen::Isometry3d& T_world_camera_estimate) const {
  Eigen::Isometry3d aligned = Eigen::Isometry3d::Identity();
  aligned.linear() = rotation_truth_estimate * T_world_camera_estimate.linear();
  aligned.translation() = (*this)(Eigen::Vector3d(T_world_camera_estimate.translation()));
  return aligned;
}

std::optional<Alignment> align(const std::vector<PosePair>& pairs, AlignmentKind kind) {
  if (pairs.size() < 3) return std::nullopt;
  const auto count = static_cast<Eigen::Index>(pairs.size());
  Eigen::Matrix3Xd estimate(3, count), truth(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const PosePair& pair = pairs[static_cast<std::size_t>(i)];
    estimate.col(i) = pair.T_world_camera_estimate.translation();
    truth.col(i) = pair.T_world_camera_truth.translation();
  }
  if (!estimate.allFinite() || !truth.allFinite()) return std::nullopt;
  const bool with_scale = kind == AlignmentKind::kSimilarity;
  if (with_scale && (!moves(estimate) || !moves(truth))) return std::nullopt;

  const Eigen::Matrix4d similarity = Eigen::umeyama(estimate, truth, with_scale);
  Alignment alignment;
  if (with_scale) alignment.scale = similarity.block<3, 1>(0, 0).norm();
  if (!(alignment.scale > 0.0) || !similarity.allFinite()) return std::nullopt;
  alignment.rotation_truth_estimate = similarity.topLeftCorner<3, 3>() / alignment.scale;
  alignment.translation = similarity.topRightCorner<3, 1>();
  return alignment;
}

double absoluteTrajectoryError(const std::vector<PosePair>& pairs, const Alignment& alignment) {
  if (pairs.empty()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d aligned =
        alignment(Eigen::Vector3d(pair.T_world_camera_estimate.translation()));
    sum += (pair.T_world_camera_truth.translation() - aligned).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

std::optional<RelativePoseError> relativePoseError(const std::vector<PosePair>& pairs,
                                                   double interval_s, double scale) {
  double translation_sum = 0.0, rotation_sum = 0.0;
  RelativePoseError result;
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < pairs.size(); ++begin) {
    const double wanted_s = pairs[begin].stamp_s + interval_s;
    if (pairs.back().stamp_s < wanted_s - 1e-3) break;
    const auto distance = [&](std::size_t i) { return std::abs(pairs[i].stamp_s - wanted_s); };
    end = std::max(end, begin);
    while (end + 1 < pairs.size() && distance(end + 1) < distance(end)) ++end;
    if (end == begin || !(distance(end) <= 0.1 * interval_s)) continue;
    const auto motion = [&](Eigen::Isometry3d PosePair::*pose) {
      return (pairs[begin].*pose).inverse() * (pairs[end].*pose);
    };
    Eigen::Isometry3d estimate = motion(&PosePair::T_world_camera_estimate);
    estimate.translation() *= scale;
    const Eigen::Isometry3d error = motion(&PosePair::T_world_camera_truth).inverse() * estimate;
    translation_sum += error.translation().squaredNorm();
    const double angle = Eigen::AngleAxisd(error.linear()).angle();
    rotation_sum += angle * angle;
    ++result.intervals;
  }
  if (result.intervals == 0) return std::nullopt;
  result.translation_rmse = std::sqrt(translation_sum / result.intervals);
  result.rotation_rmse_rad = std::sqrt(rotation_sum / result.intervals);
  return result;
}

}  // namespace active_matching_slam
