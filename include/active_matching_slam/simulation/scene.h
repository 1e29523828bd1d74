#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {

/// A flat, textured rectangle, visible from its front. Seen from the front, u points right and v
/// down; the normal v x u points at the viewer.
struct Surface {
  Eigen::Vector3d origin;  ///< top left corner, world [m]
  Eigen::Vector3d u_axis;  ///< unit
  Eigen::Vector3d v_axis;  ///< unit, orthogonal to u_axis
  double width_m = 0.0;    ///< along u
  double height_m = 0.0;   ///< along v
  /// CV_32FC1, reflectance in [0, 1]; spans the rectangle exactly: the centre of texel (i, j) of an
  /// n x m image lies at u = (i + 0.5) / n * width_m, v = (j + 0.5) / m * height_m.
  cv::Mat albedo;
  double emission = 0.0;  ///< fraction of the albedo that shines by itself, independent of lights
  bool casts_shadow = true;

  Eigen::Vector3d normal() const { return v_axis.cross(u_axis); }
  Eigen::Vector3d at(double u_m, double v_m) const { return origin + u_m * u_axis + v_m * v_axis; }
};

/// A square lamp that shines to one side: light falls off with the square of the distance and with
/// the cosines at the lamp and on the surface.
struct Light {
  Eigen::Vector3d position;
  Eigen::Vector3d normal = -Eigen::Vector3d::UnitZ();  ///< unit, where it shines to
  double size_m = 0.3;                                 ///< side of the lamp, for soft shadows
  double intensity = 1.0;  ///< irradiance on a facing surface one metre ahead, in units of grey
};

/// Where a camera may move, in the frame of the camera at the start (x right, y down, z forward).
struct Stage {
  Eigen::Isometry3d T_world_start = Eigen::Isometry3d::Identity();
  Eigen::Vector3d reach_min_m = Eigen::Vector3d::Zero();  ///< components <= 0
  Eigen::Vector3d reach_max_m = Eigen::Vector3d::Zero();  ///< components >= 0
  double size_m = 1.0;         ///< scale of hand motions: 1 for a room, less for a desk
  double loop_radius_m = 0.0;  ///< of the way round for a loop to the right; 0: there is none
};

/// A world of rectangles. z points up.
struct Scene {
  std::string name;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  double ambient = 0.3;            ///< light from everywhere, dimmed in corners
  double occlusion_range_m = 1.0;  ///< surfaces nearer than this dim the ambient light
  double light_grid_m = 0.1;       ///< spacing at which light is computed
  Stage stage;
};

/// Replaces every albedo by the light that the surface sends out (grey, 1 = white at exposure 1):
/// lamps with soft shadows, ambient light with occlusion. Surfaces are matt, so this does not
/// depend on the viewer.
void bakeLight(Scene& scene);

/// Throws std::invalid_argument that names what is wrong: axes not orthonormal, sizes not positive,
/// textures missing or of another type, a start outside its reach.
void checkScene(const Scene& scene);

}  // namespace active_matching_slam
