#include "active_matching_slam/evaluation/trajectory_error.h"

#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace active_matching_slam {

Eigen::Isometry3d Alignment::operator()(const Eigen::Isometry3d& T_world_camera_estimate) const {
  Eigen::Isometry3d aligned = Eigen::Isometry3d::Identity();
  aligned.linear() = rotation_truth_estimate * T_world_camera_estimate.linear();
  aligned.translation() = (*this)(Eigen::Vector3d(T_world_camera_estimate.translation()));
  return aligned;
}

std::optional<Alignment> align(const std::vector<PosePair>& pairs, AlignmentKind kind) {
  if (pairs.size() < 3) return std::nullopt;
  const double count = static_cast<double>(pairs.size());
  Eigen::Vector3d mean_estimate = Eigen::Vector3d::Zero(), mean_truth = Eigen::Vector3d::Zero();
  for (const PosePair& pair : pairs) {
    mean_estimate += pair.T_world_camera_estimate.translation() / count;
    mean_truth += pair.T_world_camera_truth.translation() / count;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  double variance_estimate = 0.0, variance_truth = 0.0;
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d e = pair.T_world_camera_estimate.translation() - mean_estimate;
    const Eigen::Vector3d t = pair.T_world_camera_truth.translation() - mean_truth;
    cross += t * e.transpose() / count;
    variance_estimate += e.squaredNorm() / count;
    variance_truth += t.squaredNorm() / count;
  }
  if (!cross.allFinite() || !std::isfinite(variance_estimate)) return std::nullopt;

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  // A rotation, never a reflection (Umeyama 1991, eq. 39).
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) sign.z() = -1.0;
  Alignment alignment;
  alignment.rotation_truth_estimate = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  if (kind == AlignmentKind::kSimilarity) {
    // Below these a spread is rounding.
    if (!(variance_estimate > 1e-24 * (1.0 + mean_estimate.squaredNorm()))) return std::nullopt;
    if (!(variance_truth > 1e-24 * (1.0 + mean_truth.squaredNorm()))) return std::nullopt;
    alignment.scale = svd.singularValues().dot(sign) / variance_estimate;  // eq. 42
    if (!(alignment.scale > 0.0) || !std::isfinite(alignment.scale)) return std::nullopt;
  }
  alignment.translation =
      mean_truth - alignment.scale * (alignment.rotation_truth_estimate * mean_estimate);
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
