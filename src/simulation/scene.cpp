#include "active_matching_slam/simulation/scene.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "ray_caster.h"

namespace active_matching_slam {
namespace {

/// Directions about +z with the density of the cosine, spread evenly (spiral).
std::vector<Eigen::Vector3d> cosineDirections(int count) {
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double r = std::sqrt((i + 0.5) / count), angle = 2.399963229728653 * i;
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), std::sqrt(1.0 - r * r));
  }
  return directions;
}

class LightBaker {
 public:
  explicit LightBaker(const Scene& scene)
      : scene_(scene), caster_(scene), directions_(cosineDirections(20)) {}

  double irradiance(const Surface& surface, const Eigen::Vector3d& point) const {
    const Eigen::Vector3d normal = surface.normal();
    const Eigen::Vector3d from = point + 1e-3 * normal;
    double open = 0.0;
    for (const Eigen::Vector3d& d : directions_) {
      const Eigen::Vector3d direction =
          d.x() * surface.u_axis + d.y() * surface.v_axis + d.z() * normal;
      open += caster_.freePath(from, direction, scene_.occlusion_range_m);
    }
    open /= scene_.occlusion_range_m * static_cast<double>(directions_.size());
    double light = scene_.ambient * (0.25 + 0.75 * open);
    for (const Light& lamp : scene_.lights) light += direct(lamp, normal, from);
    return light;
  }

 private:
  double direct(const Light& lamp, const Eigen::Vector3d& normal,
                const Eigen::Vector3d& from) const {
    constexpr int kSide = 3;
    const Eigen::Vector3d u = lamp.normal.unitOrthogonal(), v = lamp.normal.cross(u);
    double sum = 0.0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const double du = ((i % kSide + 0.5) / kSide - 0.5) * lamp.size_m;
      const double dv = ((i / kSide + 0.5) / kSide - 0.5) * lamp.size_m;
      const Eigen::Vector3d to = lamp.position + du * u + dv * v - from;
      const double distance = to.norm();
      const Eigen::Vector3d direction = to / distance;
      const double received = normal.dot(direction), sent = -lamp.normal.dot(direction);
      if (received <= 0.0 || sent <= 0.0) continue;
      if (caster_.isBlocked(from, direction, distance)) continue;
      sum += received * sent / std::max(distance * distance, 0.04);
    }
    return lamp.intensity * sum / (kSide * kSide);
  }

  const Scene& scene_;
  RayCaster caster_;
  std::vector<Eigen::Vector3d> directions_;
};

/// Irradiance over a surface as an image of the texture's size. Nodes lie on the borders too, so
/// light does not jump where surfaces meet.
cv::Mat lightMap(const LightBaker& baker, const Surface& s, double grid_m) {
  const int columns = 2 + static_cast<int>(s.width_m / grid_m);
  const int rows = 2 + static_cast<int>(s.height_m / grid_m);
  cv::Mat coarse(rows, columns, CV_32FC1);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      // Slightly inside: a node on an edge would see through the neighbour.
      const double u = std::clamp(static_cast<double>(i) / (columns - 1), 0.02, 0.98) * s.width_m;
      const double v = std::clamp(static_cast<double>(j) / (rows - 1), 0.02, 0.98) * s.height_m;
      coarse.at<float>(j, i) = static_cast<float>(baker.irradiance(s, s.at(u, v)));
    }
  cv::Mat map_u(s.albedo.size(), CV_32FC1), map_v(s.albedo.size(), CV_32FC1);
  for (int y = 0; y < s.albedo.rows; ++y)
    for (int x = 0; x < s.albedo.cols; ++x) {
      map_u.at<float>(y, x) = static_cast<float>((x + 0.5) / s.albedo.cols * (columns - 1));
      map_v.at<float>(y, x) = static_cast<float>((y + 0.5) / s.albedo.rows * (rows - 1));
    }
  cv::Mat fine;
  cv::remap(coarse, fine, map_u, map_v, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return fine;
}

[[noreturn]] void fail(const Scene& scene, std::size_t i, const std::string& what) {
  throw std::invalid_argument("scene '" + scene.name + "', surface " + std::to_string(i) + ": " +
                              what);
}

}  // namespace

void bakeLight(Scene& scene) {
  const LightBaker baker(scene);
  std::vector<cv::Mat> radiance;
  for (const Surface& s : scene.surfaces) {
    cv::Mat out;
    if (s.emission >= 1.0) {
      out = s.albedo * s.emission;
    } else {
      out = s.albedo.mul(lightMap(baker, s, scene.light_grid_m)) + s.emission * s.albedo;
    }
    radiance.push_back(out);
  }
  for (std::size_t i = 0; i < radiance.size(); ++i) scene.surfaces[i].albedo = radiance[i];
}

void checkScene(const Scene& scene) {
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    const Surface& s = scene.surfaces[i];
    if (!s.origin.allFinite()) fail(scene, i, "origin is not finite");
    if (!(std::abs(s.u_axis.norm() - 1.0) < 1e-9 && std::abs(s.v_axis.norm() - 1.0) < 1e-9 &&
          std::abs(s.u_axis.dot(s.v_axis)) < 1e-9))
      fail(scene, i, "axes are not orthonormal");
    if (!(s.width_m > 0.0 && s.height_m > 0.0)) fail(scene, i, "size is not positive");
    if (s.albedo.empty() || s.albedo.type() != CV_32FC1) fail(scene, i, "albedo is not CV_32FC1");
  }
  if ((scene.stage.reach_min_m.array() > 0.0).any() ||
      (scene.stage.reach_max_m.array() < 0.0).any())
    throw std::invalid_argument("scene '" + scene.name + "': the start is outside its reach");
}

}  // namespace active_matching_slam
