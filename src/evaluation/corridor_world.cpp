#include "corridor_world.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The plan [m]: the middle of the corridor is a rectangle with round corners.
constexpr double kLength = 20.0, kDepth = 10.0, kHalfWidth = 1.0, kHeight = 2.6, kEye = 1.5,
                 kCorner = 1.165;
constexpr double kRoomDepth = 2.5, kRoomWidth = 2.0;
constexpr double kFarthest = 12.0, kNearest = 0.4;

/// The middle of the corridor.
Vector2d middleAt(double walked) {
  const double sides[4] = {kLength - 2.0 * kCorner, kDepth - 2.0 * kCorner, kLength - 2.0 * kCorner,
                           kDepth - 2.0 * kCorner};
  const double arc = 0.5 * M_PI * kCorner;
  double left = std::fmod(walked, CorridorWorld::lapLength());
  if (left < 0.0) left += CorridorWorld::lapLength();
  Vector2d place(kCorner, 0.0);
  double heading = 0.0;
  for (double side : sides) {
    const Vector2d ahead(std::cos(heading), std::sin(heading));
    if (left <= side) return place + left * ahead;
    place += side * ahead;
    left -= side;
    const Vector2d centre = place + kCorner * Vector2d(-ahead.y(), ahead.x());
    const double turned = std::min(left, arc) / kCorner;
    const Eigen::Rotation2Dd turn(turned);
    if (left <= arc) return centre + turn * (place - centre);
    place = centre + turn * Vector2d(place - centre);
    heading += 0.5 * M_PI;
    left -= arc;
  }
  return place;
}

bool isWithin(const Vector2d& place, const Vector2d& low, const Vector2d& high) {
  return (place.array() >= low.array()).all() && (place.array() <= high.array()).all();
}

}  // namespace

double CorridorWorld::lapLength() {
  return 2.0 * (kLength + kDepth) - 8.0 * kCorner + 2.0 * M_PI * kCorner;
}

CorridorWorld::CorridorWorld(int points, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  // Hand: metres, then radians.
  const double amplitudes[6] = {0.03, 0.03, 0.02, 0.05, 0.10, 0.04};
  for (int axis = 0; axis < 6; ++axis) {
    for (double hz : {0.15, 0.35, 0.8}) {
      waves_[axis].push_back({amplitudes[axis] * uniform(0.3, 0.7) * 0.15 / hz,
                              2.0 * M_PI * hz * uniform(0.8, 1.25), uniform(0.0, 2.0 * M_PI)});
    }
  }
  // Rooms, outside and inside: open towards the corridor over their whole width.
  for (int i = 0; i < 6; ++i) {
    const double x = 1.0 + 3.2 * i + uniform(0.0, 1.0);
    const Vector2d across(kRoomWidth, 0.0);
    rooms_.push_back({Vector2d(x, -kHalfWidth - kRoomDepth), Vector2d(x, -kHalfWidth) + across});
    rooms_.push_back(
        {Vector2d(x, kDepth + kHalfWidth), Vector2d(x, kDepth + kHalfWidth + kRoomDepth) + across});
    if (i < 3) {
      const double y = 1.5 + 3.0 * i + uniform(-0.4, 0.4);
      rooms_.push_back({Vector2d(-kHalfWidth - kRoomDepth, y), Vector2d(-kHalfWidth, y + 1.6)});
      rooms_.push_back({Vector2d(kLength + kHalfWidth, y),
                        Vector2d(kLength + kHalfWidth + kRoomDepth, y + 1.6)});
    }
  }
  while (static_cast<int>(in_building_.size()) < points) {
    const double kind = uniform(0.0, 1.0);
    Vector3d point;
    if (kind < 0.15) {  // in a room
      const Room& room = rooms_[slot(static_cast<int>(uniform(0.0, rooms_.size() - 1e-9)))];
      for (int k = 0; k < 2; ++k) point(k) = uniform(room.low(k), room.high(k));
      point.z() = uniform(0.1, kHeight);
    } else {  // on a wall, the floor or the ceiling
      const double walked = uniform(0.0, lapLength());
      const Vector2d ahead = (middleAt(walked + 0.05) - middleAt(walked - 0.05)).normalized();
      const Vector2d left(-ahead.y(), ahead.x());
      const double beside = kind < 0.7 ? (uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0) * kHalfWidth * 0.999
                                       : uniform(-kHalfWidth, kHalfWidth);
      const Vector2d place = middleAt(walked) + beside * left;
      const double height = kind < 0.7 ? uniform(0.05, kHeight) : (kind < 0.85 ? 0.0 : kHeight);
      point << place, height;
    }
    if (isOpen(point.head<2>())) in_building_.push_back(point);
  }
  T_building_world_ = cameraInBuilding(0.0, 0.0);
  for (const Vector3d& point : in_building_) {
    points_.push_back(T_building_world_.inverse() * point);
  }
}

double CorridorWorld::sway(int axis, double time_s) const {
  double sum = 0.0;
  for (const Wave& wave : waves_[axis]) {
    sum += wave.amplitude * std::sin(wave.omega * time_s + wave.phase);
  }
  return sum;
}

bool CorridorWorld::isOpen(const Vector2d& place) const {
  const Vector2d outer(kHalfWidth, kHalfWidth);
  const bool in_ring = isWithin(place, -outer, Vector2d(kLength, kDepth) + outer) &&
                       !(place.x() > kHalfWidth && place.x() < kLength - kHalfWidth &&
                         place.y() > kHalfWidth && place.y() < kDepth - kHalfWidth);
  if (in_ring) return true;
  for (const Room& room : rooms_) {
    if (isWithin(place, room.low, room.high)) return true;
  }
  return false;
}

Eigen::Isometry3d CorridorWorld::cameraInBuilding(double walked_m, double time_s) const {
  const Vector2d place = middleAt(walked_m);
  const Vector2d ahead = (middleAt(walked_m + 0.9) - middleAt(walked_m - 0.4)).normalized();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear().col(2) << ahead, 0.0;
  T.linear().col(1) = -Vector3d::UnitZ();
  T.linear().col(0) = T.linear().col(1).cross(T.linear().col(2));
  T.translation() << place + Vector2d(sway(0, time_s), sway(1, time_s)), kEye + sway(2, time_s);
  for (int axis = 0; axis < 3; ++axis) {
    T.linear() = T.linear() *
                 Eigen::AngleAxisd(sway(3 + axis, time_s), Vector3d::Unit(axis)).toRotationMatrix();
  }
  return T;
}

Eigen::Isometry3d CorridorWorld::camera(double walked_m, double time_s) const {
  return T_building_world_.inverse() * cameraInBuilding(walked_m, time_s);
}

std::optional<Vector2d> CorridorWorld::project(const CameraModel& model,
                                               const Eigen::Isometry3d& T_world_camera,
                                               int point) const {
  const Vector3d in_camera = T_world_camera.inverse() * points_[slot(point)];
  if (in_camera.z() < kNearest || in_camera.norm() > kFarthest) return std::nullopt;
  const auto pixel = model.project(in_camera);
  if (!pixel || !model.isInImage(*pixel, 10.0)) return std::nullopt;
  const Vector2d from = (T_building_world_ * T_world_camera.translation()).head<2>();
  const Vector2d to = in_building_[slot(point)].head<2>();
  const int steps = static_cast<int>((to - from).norm() / 0.15);
  for (int i = 1; i < steps; ++i) {
    if (!isOpen(from + (to - from) * i / steps)) return std::nullopt;
  }
  return pixel;
}

}  // namespace active_matching_slam
