#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "active_matching_slam/information/map_structure.h"

namespace active_matching_slam {
namespace test {

/// A camera that moves by unknown accelerations past points, as a linear Gaussian problem: no
/// image, no estimate, only how the errors of camera and points hang together when everything is
/// linear about the truth. Its S is what a tracker would predict. World: x right, y down, z
/// forward, as the camera at rest. Units: m, rad, s, px.
struct WorldPoint {
  Eigen::Vector3d position;
  int group = 0;         ///< what the right answer calls its submap
  double start_s = 0.0;  ///< not taken into the map before this time
};

struct CameraPose {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  double yaw = 0.0;  ///< about the camera's y: positive looks to the right
};

struct CovarianceWorld {
  std::vector<WorldPoint> points;             ///< ids follow their first sight, not this order
  std::function<CameraPose(double)> pose_at;  ///< of time [s]
  double duration_s = 6.0;
  double interval_s = 0.1;
  double acceleration_sigma = 4.0;          ///< m/s^2
  double angular_acceleration_sigma = 2.0;  ///< rad/s^2
  double focal_px = 500.0;
  Eigen::Vector2d half_image_px = {320.0, 240.0};
  double noise_px = 1.0;
};

/// The world's structure after the camera has run through it, and each feature's group by id.
struct WorldStructure {
  MapStructure::Snapshot snapshot;
  std::vector<int> group_of_id;  ///< id = order of first sight
};

namespace detail {

struct Camera {
  Eigen::Matrix3d R_camera_world;
  Eigen::Vector3d position_world;
};

inline Camera cameraAt(const CovarianceWorld& world, double time) {
  const CameraPose pose = world.pose_at(time);
  const Eigen::Matrix3d R_world_camera =
      Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return {R_world_camera.transpose(), pose.position_world};
}

inline bool visible(const CovarianceWorld& world, const Eigen::Vector3d& p_camera) {
  return p_camera.z() > 0.2 &&
         std::abs(world.focal_px * p_camera.x() / p_camera.z()) < world.half_image_px.x() &&
         std::abs(world.focal_px * p_camera.y() / p_camera.z()) < world.half_image_px.y();
}

/// Jacobians of a point's image by the camera's position and rotation error, and by the point.
struct Jacobians {
  Eigen::Matrix<double, 2, 6> camera;
  Eigen::Matrix<double, 2, 3> point;
};

inline Jacobians jacobians(double focal_px, const Camera& camera, const Eigen::Vector3d& p_camera) {
  const double x = p_camera.x(), y = p_camera.y(), z = p_camera.z();
  Eigen::Matrix<double, 2, 3> project;
  project << 1.0 / z, 0.0, -x / (z * z), 0.0, 1.0 / z, -y / (z * z);
  project *= focal_px;
  Eigen::Matrix3d cross;
  cross << 0.0, -z, y, z, 0.0, -x, -y, x, 0.0;
  Jacobians J;
  J.point = project * camera.R_camera_world;
  J.camera << -J.point, project * cross;
  return J;
}

}  // namespace detail

/// Runs the camera through the world. After each frame `after_frame` is called with the groups of
/// all features so far, by id.
inline void runWorld(const CovarianceWorld& world, MapStructure& structure,
                     const std::function<void(const std::vector<int>&)>& after_frame) {
  using Eigen::MatrixXd;
  constexpr int kCamera = 12;  // position, rotation, velocity, angular velocity
  const double dt = world.interval_s;
  MatrixXd P = MatrixXd::Zero(kCamera, kCamera);
  P.diagonal().segment<3>(6).setConstant(0.1);
  P.diagonal().segment<3>(9).setConstant(0.01);
  Eigen::Matrix<double, kCamera, kCamera> F, Q;
  F.setIdentity();
  F.topRightCorner<6, 6>() = dt * Eigen::Matrix<double, 6, 6>::Identity();
  Eigen::Matrix<double, kCamera, 6> G;
  G << dt * dt * Eigen::Matrix<double, 6, 6>::Identity(),
      dt * Eigen::Matrix<double, 6, 6>::Identity();
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(world.acceleration_sigma),
      Eigen::Vector3d::Constant(world.angular_acceleration_sigma);
  Q = G * sigma.array().square().matrix().asDiagonal() * G.transpose();

  std::vector<int> group_of_id, id_of_point(world.points.size(), -1);
  const int frames = static_cast<int>(world.duration_s / dt);
  for (int frame = 0; frame < frames; ++frame) {
    if (frame > 0) {
      P.topRows(kCamera) = (F * P.topRows(kCamera)).eval();
      P.leftCols(kCamera) = (P.leftCols(kCamera) * F.transpose()).eval();
      P.topLeftCorner<kCamera, kCamera>() += Q;
    }
    const detail::Camera camera = detail::cameraAt(world, frame * dt);
    std::vector<std::int64_t> ids;
    std::vector<detail::Jacobians> J;
    std::size_t known = 0;  // features that were in the map before this frame come first
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t k = 0; k < world.points.size(); ++k) {
        const Eigen::Vector3d p_camera =
            camera.R_camera_world * (world.points[k].position - camera.position_world);
        const bool is_new = id_of_point[k] < 0;
        if (is_new != (pass == 1) || !detail::visible(world, p_camera)) continue;
        if (frame * dt < world.points[k].start_s) continue;
        if (is_new) {
          // Nothing is known of a new point but its rough distance.
          id_of_point[k] = static_cast<int>(group_of_id.size());
          group_of_id.push_back(world.points[k].group);
          const Eigen::Index n = P.rows();
          P.conservativeResizeLike(MatrixXd::Zero(n + 3, n + 3));
          P.diagonal().tail<3>().setConstant(0.25 * p_camera.squaredNorm());
        }
        ids.push_back(id_of_point[k]);
        J.push_back(detail::jacobians(world.focal_px, camera, p_camera));
      }
      if (pass == 0) known = ids.size();
    }
    const Eigen::Index m = 2 * static_cast<Eigen::Index>(ids.size());
    MatrixXd PHt(P.rows(), m), S(m, m);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      PHt.middleCols<2>(2 * i) = P.leftCols<6>() * J[i].camera.transpose() +
                                 P.middleCols<3>(kCamera + 3 * ids[i]) * J[i].point.transpose();
    }
    for (std::size_t i = 0; i < ids.size(); ++i) {
      S.middleRows<2>(2 * i) =
          J[i].camera * PHt.topRows<6>() + J[i].point * PHt.middleRows<3>(kCamera + 3 * ids[i]);
    }
    S.diagonal().array() += world.noise_px * world.noise_px;
    S = (0.5 * (S + S.transpose())).eval();
    if (known > 0) {
      structure.addFrame({ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(known)},
                         S.topLeftCorner(2 * known, 2 * known));
    }
    if (m == 0) continue;
    const Eigen::LLT<MatrixXd> llt(S);
    const MatrixXd half = llt.matrixL().solve(PHt.transpose());
    P -= half.transpose() * half;
    P = (0.5 * (P + P.transpose())).eval();
    after_frame(group_of_id);
  }
}

inline WorldStructure structureOf(const CovarianceWorld& world) {
  MapStructure structure;
  WorldStructure result;
  runWorld(world, structure,
           [&](const std::vector<int>& group_of_id) { result.group_of_id = group_of_id; });
  result.snapshot = structure.snapshot();
  return result;
}

/// Even spread over [-1, 1], the same on every platform.
class Spread {
 public:
  explicit Spread(unsigned seed) : generator_(seed) {}
  double operator()() { return 2.0 * (generator_() / 4294967295.0) - 1.0; }
  unsigned below(unsigned bound) { return generator_() % bound; }

 private:
  std::mt19937 generator_;
};

}  // namespace test
}  // namespace active_matching_slam
