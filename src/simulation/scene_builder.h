#pragma once

#include <cstdint>
#include <functional>

#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/scene.h"
#include "active_matching_slam/simulation/textures.h"

namespace active_matching_slam {

/// Puts rectangles, boxes and prisms into a scene. z is up; lengths in metres, angles in radians.
class SceneBuilder {
 public:
  using Paint = std::function<cv::Mat(const Canvas&)>;

  SceneBuilder(std::string name, std::uint64_t seed) : seed_(seed) {
    scene_.name = std::move(name);
  }

  Scene& scene() { return scene_; }
  /// Texels per metre of what is added from now on.
  void density(double texels_per_m) { density_ = texels_per_m; }

  // Rectangles that hang on a wall or lie on something: they cast no shadow.

  /// An upright rectangle around `centre`, seen from the side to which `facing_rad` points (0: +x,
  /// counter-clockwise from above).
  void upright(const Eigen::Vector3d& centre, double facing_rad, double width_m, double height_m,
               const Paint& paint, double emission = 0.0);
  /// A level rectangle around `centre`, seen from above (or from below). `yaw_rad` turns it.
  void level(const Eigen::Vector3d& centre, double yaw_rad, double size_x_m, double size_y_m,
             const Paint& paint, bool from_above = true, double emission = 0.0);
  // Bodies, which cast shadows.

  /// As upright() and level().
  void solidUpright(const Eigen::Vector3d& centre, double facing_rad, double width_m,
                    double height_m, const Paint& paint);
  void solidLevel(const Eigen::Vector3d& centre, double yaw_rad, double size_x_m, double size_y_m,
                  const Paint& paint, bool from_above = true);
  /// A box that stands on `base_centre`, its front to -y before it is turned by `yaw_rad`. The
  /// bottom is left out unless asked for.
  void box(const Eigen::Vector3d& base_centre, double yaw_rad, const Eigen::Vector3d& size,
           const Paint& front, const Paint& sides, const Paint& top, bool bottom = false);
  void box(const Eigen::Vector3d& base_centre, double yaw_rad, const Eigen::Vector3d& size,
           const Paint& paint, bool bottom = false) {
    box(base_centre, yaw_rad, size, paint, paint, paint, bottom);
  }
  /// An upright prism with `sides` sides and a lid.
  void prism(const Eigen::Vector3d& base_centre, double radius_m, double height_m, int sides,
             const Paint& side, const Paint& lid);
  /// A table top with four legs.
  void table(const Eigen::Vector3d& base_centre, double yaw_rad, const Eigen::Vector3d& size,
             double level);
  /// A pile of books or boxes.
  void pile(const Eigen::Vector3d& base_centre, double yaw_rad, int count, double width_m,
            double depth_m, const Paint& cover);
  /// Shelves with rows of books; its back towards +y before it is turned.
  void bookcase(const Eigen::Vector3d& base_centre, double yaw_rad, double width_m, double height_m,
                int boards);
  void monitor(const Eigen::Vector3d& base_centre, double yaw_rad, double width_m);
  void chair(const Eigen::Vector3d& base_centre, double yaw_rad);
  /// A room seen from within: floor, ceiling and four walls (towards +y, +x, -y, -x).
  void room(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Paint& floor,
            const Paint& ceiling, const std::vector<Paint>& walls);
  void lamp(const Eigen::Vector3d& position, double size_m, double intensity,
            const Eigen::Vector3d& normal = -Eigen::Vector3d::UnitZ());

  /// All that is there once more, turned about the world's z axis.
  void repeatTurned(double yaw_rad);

  /// The sky around `middle`, with hills towards +y.
  void sky(const Eigen::Vector3d& middle, double distance_m, double height_m);

  /// The camera at the start, level but for `pitch_rad` (down), looking along `heading_rad` (0:
  /// +x).
  void start(const Eigen::Vector3d& position, double heading_rad, double pitch_rad,
             const Eigen::Vector3d& reach_min, const Eigen::Vector3d& reach_max, double size_m);

  Random& random() { return random_; }
  /// Lights the scene and hands it over.
  Scene finish();

 private:
  void add(const Eigen::Vector3d& centre, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
           double width_m, double height_m, const Paint& paint, double emission, bool casts_shadow);

  Scene scene_;
  std::uint64_t seed_;
  Random random_{seed_ + 17};
  double density_ = 400.0;
};

/// A surface of one grey level, 0 to 1, with nothing on it.
inline SceneBuilder::Paint plain(double level) {
  return [level](const Canvas& c) { return paintPlain(c, level); };
}
/// A wall of that grey level.
inline SceneBuilder::Paint plaster(double level) {
  return [level](const Canvas& c) { return paintPlaster(c, level); };
}

/// The places of scenes_indoor.cpp and scenes_long.cpp.
Scene makeRoom(std::uint64_t seed);
Scene makeOffice(std::uint64_t seed);
Scene makeDesk(std::uint64_t seed);
Scene makeCheckerboard(std::uint64_t seed);
Scene makeTwoDepths(std::uint64_t seed);
Scene makeCorridor(std::uint64_t seed);
Scene makeCorridorEnd(std::uint64_t seed);
Scene makeCorridorLoop(std::uint64_t seed);
Scene makeRooms(std::uint64_t seed);
Scene makeWall(std::uint64_t seed);
Scene makePlanks(std::uint64_t seed);
Scene makeWalkway(std::uint64_t seed);

}  // namespace active_matching_slam
