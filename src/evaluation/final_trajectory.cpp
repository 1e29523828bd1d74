#include "active_matching_slam/evaluation/final_trajectory.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Derivation: a pose takes three points; twice as many tell when one of them is off.
constexpr std::size_t kLeastSightings = 6;
constexpr int kResectionSteps = 20;
/// Of a Gauss-Newton step, in radians and parts of the distance to the points. Derivation: far
/// below what a pixel is, far above rounding.
constexpr double kSmallStep = 1e-7;
/// Of the normal equations. Derivation: a pose whose worst direction is known a thousand times less
/// well than its best (the square of that) is not known.
constexpr double kLeastCondition = 1e-6;
/// Standard: 95 % efficient where errors are Gaussian (Huber 1981).
constexpr double kHuberSigmas = 1.345;
/// Standard: sigma of a Gaussian over its median absolute deviation.
constexpr double kSigmaOverMedian = 1.4826;

struct Correction {
  Vector3d shift;
  Eigen::Quaterniond turn;
};

Isometry3d corrected(const Isometry3d& pose, const Correction& correction) {
  Isometry3d result;
  result.linear() = (correction.turn * Eigen::Quaterniond(pose.linear())).toRotationMatrix();
  result.translation() = pose.translation() + correction.shift;
  return result;
}

/// Of frames that have none, from those before and after: by stamp.
std::vector<Correction> filled(const std::vector<std::optional<Correction>>& known,
                               const Trajectory& poses) {
  std::vector<Correction> result;
  const int count = static_cast<int>(known.size());
  std::vector<int> after(known.size() + 1, -1);
  for (int i = count - 1; i >= 0; --i)
    after[static_cast<std::size_t>(i)] =
        known[static_cast<std::size_t>(i)] ? i : after[static_cast<std::size_t>(i) + 1];
  int before = -1;
  for (int i = 0; i < count; ++i) {
    const int next = after[static_cast<std::size_t>(i)];
    if (next == i) before = i;
    if (before < 0 && next < 0) {
      result.push_back({Vector3d::Zero(), Eigen::Quaterniond::Identity()});
      continue;
    }
    const Correction& a = *known[static_cast<std::size_t>(before < 0 ? next : before)];
    const Correction& b = *known[static_cast<std::size_t>(next < 0 ? before : next)];
    const auto stamp = [&](int k) { return poses[static_cast<std::size_t>(k)].stamp_s; };
    const double length = before < 0 || next < 0 ? 0.0 : stamp(next) - stamp(before);
    const double part = length > 0.0 ? (stamp(i) - stamp(before)) / length : 0.0;
    result.push_back({a.shift + part * (b.shift - a.shift), a.turn.slerp(part, b.turn)});
  }
  return result;
}

}  // namespace

std::optional<Isometry3d> resect(const std::vector<Vector3d>& points,
                                 const std::vector<Vector3d>& directions, const Isometry3d& start) {
  if (points.size() < kLeastSightings || directions.size() != points.size()) return std::nullopt;
  Isometry3d pose = start;
  for (int step = 0; step < kResectionSteps; ++step) {
    std::vector<Vector3d> seen, residuals;
    std::vector<double> distances, sizes;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector3d ray = pose.inverse() * points[i];
      distances.push_back(ray.norm());
      if (!(distances.back() > 0.0)) return std::nullopt;
      seen.push_back(ray / distances.back());
      residuals.push_back(directions[i] - seen.back());
      sizes.push_back(residuals.back().norm());
    }
    const double bound = kHuberSigmas * kSigmaOverMedian * medianOf(sizes);
    const double length = medianOf(distances);  // unit of the shift
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double weight = sizes[i] > bound ? bound / sizes[i] : 1.0;
      // The direction's change by a shift and a turn of the camera, both in its own frame.
      Eigen::Matrix<double, 3, 6> J;
      const Vector3d& m = seen[i];
      J << -(Eigen::Matrix3d::Identity() - m * m.transpose()) * (length / distances[i]), skew(m);
      normal += weight * J.transpose() * J;
      right += weight * J.transpose() * residuals[i];
    }
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(normal);
    const Eigen::Matrix<double, 6, 1> pivots = factor.vectorD();
    if (factor.info() != Eigen::Success ||
        !(pivots.minCoeff() > kLeastCondition * pivots.maxCoeff()))
      return std::nullopt;
    const Eigen::Matrix<double, 6, 1> change = factor.solve(right);
    if (!change.allFinite()) return std::nullopt;
    pose.translation() += length * (pose.linear() * change.head<3>());
    pose.linear() = (Eigen::Quaterniond(pose.linear()) * rotationFromVector(change.tail<3>()))
                        .normalized()
                        .toRotationMatrix();
    if (change.norm() < kSmallStep) return pose;
  }
  return std::nullopt;
}

void FinalTrajectory::add(const TrackedFrame& frame) {
  poses_.reset();
  if (frame.map != map_) {
    frames_.clear();
    loops_.clear();
  }
  map_ = frame.map;
  while (static_cast<int>(loops_.size()) < frame.loops) loops_.push_back(frames_.size());
  while (static_cast<int>(loops_.size()) > frame.loops) {
    // Taken back: the map that was seen since is no more, and other features have its numbers.
    for (std::size_t i = loops_.back(); i < frames_.size(); ++i) frames_[i].sightings.clear();
    loops_.pop_back();
  }
  if (frame.rescaled_by != 1.0)
    for (Frame& earlier : frames_) earlier.pose.T_world_camera.translation() *= frame.rescaled_by;
  positions_.clear();
  for (const TrackedFeature& feature : frame.features)
    if (feature.position_world.allFinite()) positions_[feature.id] = feature.position_world;
  if (frame.frozen)
    for (const FrozenFeature& feature : frame.frozen->features)
      positions_[feature.id] = feature.position_world;
  if (frame.state != TrackingState::kTracking || frame.image.empty()) return;
  Frame kept;
  kept.pose = {frame.stamp_s, frame.camera.poseWorldCamera()};
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status != FeatureStatus::kMatched || !feature.position_world.allFinite()) continue;
    const Vector3d ray = kept.pose.T_world_camera.inverse() * feature.position_world;
    if (ray.norm() > 0.0) kept.sightings.push_back({feature.id, ray.normalized().cast<float>()});
  }
  frames_.push_back(std::move(kept));
}

const Trajectory& FinalTrajectory::poses() const {
  if (poses_) return *poses_;
  Trajectory poses;
  std::vector<std::optional<Correction>> corrections;
  for (const Frame& frame : frames_) {
    poses.push_back(frame.pose);
    std::vector<Vector3d> points, directions;
    for (const Sighting& sighting : frame.sightings) {
      const auto position = positions_.find(sighting.id);
      if (position == positions_.end()) continue;
      points.push_back(position->second);
      directions.push_back(sighting.direction_camera.cast<double>().normalized());
    }
    corrections.emplace_back();
    const Isometry3d& old = frame.pose.T_world_camera;
    if (const auto found = resect(points, directions, old))
      corrections.back() =
          Correction{found->translation() - old.translation(),
                     Eigen::Quaterniond(found->linear() * old.linear().transpose()).normalized()};
  }
  const std::vector<Correction> all = filled(corrections, poses);
  for (std::size_t i = 0; i < poses.size(); ++i)
    poses[i].T_world_camera = corrected(poses[i].T_world_camera, all[i]);
  return poses_.emplace(std::move(poses));
}

}  // namespace active_matching_slam
