#include "ray_caster.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

constexpr int kLeafSize = 4;
constexpr int kMostPending = 64;  ///< depth of the tree is far below

/// True when the ray passes the box before `reach`.
bool meets(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& from,
           const Eigen::Vector3d& inverse, double reach) {
  double enter = 0.0, leave = reach;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.min()[axis] - from[axis]) * inverse[axis];
    const double b = (box.max()[axis] - from[axis]) * inverse[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

}  // namespace

RayCaster::RayCaster(const Scene& scene) {
  for (const Surface& s : scene.surfaces) {
    if (!s.casts_shadow) continue;
    Caster c{s.origin, s.u_axis, s.v_axis, s.normal(), s.width_m, s.height_m, {}};
    for (double u : {0.0, s.width_m})
      for (double v : {0.0, s.height_m}) c.bounds.extend(s.at(u, v));
    // Never quite flat: a ray within the plane of a box would be 0 * infinity.
    c.bounds.min().array() -= 1e-6;
    c.bounds.max().array() += 1e-6;
    casters_.push_back(c);
  }
  if (!casters_.empty()) build(0, static_cast<int>(casters_.size()));
}

int RayCaster::build(int first, int last) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Eigen::AlignedBox3d bounds, centres;
  for (int i = first; i < last; ++i) {
    bounds.extend(casters_[i].bounds);
    centres.extend(casters_[i].bounds.center());
  }
  nodes_[index].bounds = bounds;
  if (last - first <= kLeafSize) {
    nodes_[index].first = first;
    nodes_[index].count = last - first;
    return index;
  }
  int axis = 0;
  centres.sizes().maxCoeff(&axis);
  std::stable_sort(casters_.begin() + first, casters_.begin() + last,
                   [axis](const Caster& a, const Caster& b) {
                     return a.bounds.center()[axis] < b.bounds.center()[axis];
                   });
  const int middle = (first + last) / 2;
  const int left = build(first, middle), right = build(middle, last);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

template <bool kAnyHit>
double RayCaster::nearest(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                          double reach_m) const {
  if (nodes_.empty()) return reach_m;
  const Eigen::Vector3d inverse = direction.cwiseInverse();
  int pending[kMostPending], count = 0;
  pending[count++] = 0;
  double nearest = reach_m;
  while (count > 0) {
    const Node& node = nodes_[pending[--count]];
    if (!meets(node.bounds, from, inverse, nearest)) continue;
    if (node.count == 0) {
      pending[count++] = node.left;
      pending[count++] = node.right;
      continue;
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const Caster& c = casters_[i];
      const double slope = c.normal.dot(direction);
      if (kAnyHit ? std::abs(slope) < 1e-12 : slope > -1e-12) continue;
      const Eigen::Vector3d offset = from - c.origin;
      const double t = -c.normal.dot(offset) / slope;
      if (!(t > 1e-4 && t < nearest)) continue;
      const Eigen::Vector3d hit = offset + t * direction;
      const double u = c.u_axis.dot(hit), v = c.v_axis.dot(hit);
      if (u < 0.0 || v < 0.0 || u > c.width_m || v > c.height_m) continue;
      nearest = t;
      if (kAnyHit) return nearest;
    }
  }
  return nearest;
}

double RayCaster::freePath(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                           double reach_m) const {
  return nearest<false>(from, direction, reach_m);
}

bool RayCaster::isBlocked(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                          double reach_m) const {
  return nearest<true>(from, direction, reach_m - 1e-4) < reach_m - 1e-4;
}

}  // namespace active_matching_slam
