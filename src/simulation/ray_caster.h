#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "active_matching_slam/simulation/scene.h"

namespace active_matching_slam {

/// Finds what a ray meets among the surfaces of a scene that cast shadows: a tree of boxes.
class RayCaster {
 public:
  explicit RayCaster(const Scene& scene);

  /// Distance along the unit direction to the nearest surface that is met from its front, or
  /// `reach_m` when there is none nearer.
  double freePath(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                  double reach_m) const;
  /// True when a surface, met from either side, lies nearer than `reach_m`.
  bool isBlocked(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                 double reach_m) const;

 private:
  struct Caster {
    Eigen::Vector3d origin, u_axis, v_axis, normal;
    double width_m, height_m;
    Eigen::AlignedBox3d bounds;
  };
  struct Node {
    Eigen::AlignedBox3d bounds;
    int first = 0, count = 0;  ///< casters of a leaf; count 0: an inner node
    int left = -1, right = -1;
  };
  int build(int first, int last);
  template <bool kAnyHit>
  double nearest(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                 double reach_m) const;

  std::vector<Caster> casters_;
  std::vector<Node> nodes_;
};

}  // namespace active_matching_slam
