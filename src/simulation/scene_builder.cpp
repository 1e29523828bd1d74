#include "scene_builder.h"

#include <cmath>

namespace active_matching_slam {
namespace {

using Eigen::Vector3d;

Vector3d turned(double yaw_rad, double x, double y, double z) {
  return {std::cos(yaw_rad) * x - std::sin(yaw_rad) * y,
          std::sin(yaw_rad) * x + std::cos(yaw_rad) * y, z};
}

}  // namespace

void SceneBuilder::add(const Vector3d& centre, const Vector3d& u, const Vector3d& v, double width_m,
                       double height_m, const Paint& paint, double emission, bool casts_shadow) {
  Surface s;
  s.u_axis = u;
  s.v_axis = v;
  s.width_m = width_m;
  s.height_m = height_m;
  s.origin = centre - 0.5 * width_m * u - 0.5 * height_m * v;
  s.emission = emission;
  s.casts_shadow = casts_shadow;
  s.albedo = paint(Canvas{width_m, height_m, density_, random_.next() ^ seed_});
  scene_.surfaces.push_back(std::move(s));
}

void SceneBuilder::upright(const Vector3d& centre, double facing_rad, double width_m,
                           double height_m, const Paint& paint, double emission) {
  add(centre, turned(facing_rad, 0, 1, 0), -Vector3d::UnitZ(), width_m, height_m, paint, emission,
      false);
}

void SceneBuilder::level(const Vector3d& centre, double yaw_rad, double size_x_m, double size_y_m,
                         const Paint& paint, bool from_above, double emission) {
  add(centre, turned(yaw_rad, 1, 0, 0), turned(yaw_rad, 0, from_above ? -1 : 1, 0), size_x_m,
      size_y_m, paint, emission, false);
}

void SceneBuilder::solidUpright(const Vector3d& centre, double facing_rad, double width_m,
                                double height_m, const Paint& paint) {
  upright(centre, facing_rad, width_m, height_m, paint);
  scene_.surfaces.back().casts_shadow = true;
}

void SceneBuilder::solidLevel(const Vector3d& centre, double yaw_rad, double size_x_m,
                              double size_y_m, const Paint& paint, bool from_above) {
  level(centre, yaw_rad, size_x_m, size_y_m, paint, from_above);
  scene_.surfaces.back().casts_shadow = true;
}

void SceneBuilder::box(const Vector3d& base_centre, double yaw_rad, const Vector3d& size,
                       const Paint& front, const Paint& sides, const Paint& top, bool bottom) {
  const Vector3d middle = base_centre + Vector3d(0, 0, 0.5 * size.z());
  const auto face = [&](double x, double y) {
    return Vector3d(middle + turned(yaw_rad, 0.5 * x * size.x(), 0.5 * y * size.y(), 0));
  };
  solidUpright(face(0, -1), yaw_rad - 0.5 * M_PI, size.x(), size.z(), front);
  solidUpright(face(1, 0), yaw_rad, size.y(), size.z(), sides);
  solidUpright(face(0, 1), yaw_rad + 0.5 * M_PI, size.x(), size.z(), sides);
  solidUpright(face(-1, 0), yaw_rad + M_PI, size.y(), size.z(), sides);
  solidLevel(base_centre + Vector3d(0, 0, size.z()), yaw_rad, size.x(), size.y(), top);
  if (bottom) solidLevel(base_centre, yaw_rad, size.x(), size.y(), sides, false);
}

void SceneBuilder::prism(const Vector3d& base_centre, double radius_m, double height_m, int sides,
                         const Paint& side, const Paint& lid) {
  const double step = 2.0 * M_PI / sides;
  const double apothem = radius_m * std::cos(0.5 * step),
               width = 2.0 * radius_m * std::sin(0.5 * step);
  for (int i = 0; i < sides; ++i)
    solidUpright(base_centre + turned(i * step, apothem, 0, 0.5 * height_m), i * step, width,
                 height_m, side);
  const double across = std::sqrt(2.0) * apothem;  // a square lid that stays inside the rim
  solidLevel(base_centre + Vector3d(0, 0, height_m - 0.004), 0.0, across, across, lid);
}

void SceneBuilder::table(const Vector3d& base_centre, double yaw_rad, const Vector3d& size,
                         double tone) {
  constexpr double kTop = 0.035, kLeg = 0.05;
  const Paint wood = [tone](const Canvas& c) { return paintWood(c, tone); };
  const double legs = size.z() - kTop;
  box(base_centre + Vector3d(0, 0, legs), yaw_rad, {size.x(), size.y(), kTop}, wood, true);
  for (double x : {-1.0, 1.0})
    for (double y : {-1.0, 1.0})
      box(base_centre +
              turned(yaw_rad, x * (0.5 * size.x() - kLeg), y * (0.5 * size.y() - kLeg), 0),
          yaw_rad, {kLeg, kLeg, legs}, wood);
}

void SceneBuilder::pile(const Vector3d& base_centre, double yaw_rad, int count, double width_m,
                        double depth_m, const Paint& cover) {
  double height = 0.0;
  for (int i = 0; i < count; ++i) {
    const double thick = random_.uniform(0.02, 0.05), shrink = 1.0 - 0.07 * i;
    const Paint pages = [](const Canvas& c) { return paintFabric(c, 0.75); };
    const Paint spine = [](const Canvas& c) { return paintBookCover(c); };
    box(base_centre + Vector3d(0, 0, height), yaw_rad + random_.uniform(-0.25, 0.25),
        {width_m * shrink, depth_m * shrink, thick}, spine, pages, cover);
    height += thick;
  }
}

void SceneBuilder::bookcase(const Vector3d& base_centre, double yaw_rad, double width_m,
                            double height_m, int boards) {
  constexpr double kDepth = 0.28, kBoard = 0.022;
  const Paint wood = [](const Canvas& c) { return paintWood(c, 0.42); };
  const Paint back = [](const Canvas& c) { return paintWood(c, 0.3); };
  const Paint books = [](const Canvas& c) { return paintBookSpines(c); };
  const Paint cloth = [](const Canvas& c) { return paintFabric(c, 0.45); };
  const Paint package = [](const Canvas& c) { return paintPackage(c); };
  const auto place = [&](double x, double y, double z) {
    return Vector3d(base_centre + turned(yaw_rad, x, y, z));
  };
  for (double side : {-1.0, 1.0})
    box(place(side * 0.5 * (width_m - kBoard), 0, 0), yaw_rad, {kBoard, kDepth, height_m}, wood);
  upright(place(0, 0.5 * kDepth - 0.01, 0.5 * height_m), yaw_rad - 0.5 * M_PI, width_m, height_m,
          back);
  const double pitch = (height_m - kBoard) / boards, inside = width_m - 2.0 * kBoard;
  for (int i = 0; i <= boards; ++i) {
    const double z = i * pitch;
    box(place(0, 0, z), yaw_rad, {inside, kDepth, kBoard}, wood, true);
    if (i == boards) break;
    // Two or three groups a board, at depths of their own, with gaps.
    double x = -0.5 * inside + random_.uniform(0.0, 0.04);
    while (x < 0.5 * inside - 0.12) {
      const double w = std::min(random_.uniform(0.22, 0.5) * inside, 0.5 * inside - x);
      const bool odd = random_.uniform() < 0.2;
      const double tall = pitch * (odd ? random_.uniform(0.35, 0.6) : random_.uniform(0.62, 0.82));
      const double deep = random_.uniform(0.15, 0.21);
      box(place(x + 0.5 * w, 0.5 * (kDepth - deep) - 0.012, z + kBoard), yaw_rad, {w, deep, tall},
          odd ? package : books, cloth, cloth);
      x += w + random_.uniform(0.01, 0.07);
    }
  }
}

void SceneBuilder::monitor(const Vector3d& base_centre, double yaw_rad, double width_m) {
  const Paint dark = [](const Canvas& c) { return paintPlain(c, 0.12); };
  const Paint screen = [](const Canvas& c) { return paintScreen(c); };
  const double height = 0.58 * width_m;
  box(base_centre, yaw_rad, {0.24, 0.18, 0.012}, dark);
  box(base_centre + turned(yaw_rad, 0, 0.03, 0.012), yaw_rad, {0.05, 0.03, 0.12}, dark);
  box(base_centre + turned(yaw_rad, 0, 0, 0.11), yaw_rad, {width_m, 0.035, height}, dark, true);
  upright(base_centre + turned(yaw_rad, 0, -0.0185, 0.11 + 0.5 * height), yaw_rad - 0.5 * M_PI,
          width_m, height, screen, 0.6);
}

void SceneBuilder::chair(const Vector3d& base_centre, double yaw_rad) {
  const Paint wood = [](const Canvas& c) { return paintWood(c, 0.55); };
  const Paint cloth = [](const Canvas& c) { return paintFabric(c, 0.3); };
  for (double x : {-0.19, 0.19})
    for (double y : {-0.19, 0.19})
      box(base_centre + turned(yaw_rad, x, y, 0), yaw_rad, {0.04, 0.04, y > 0 ? 0.92 : 0.43}, wood);
  box(base_centre + Vector3d(0, 0, 0.43), yaw_rad, {0.43, 0.43, 0.05}, cloth, true);
  for (double z : {0.58, 0.72, 0.86})
    box(base_centre + turned(yaw_rad, 0, 0.19, z), yaw_rad, {0.34, 0.022, 0.07}, wood, true);
}

void SceneBuilder::room(const Vector3d& low, const Vector3d& high, const Paint& floor,
                        const Paint& ceiling, const std::vector<Paint>& walls) {
  const Vector3d size = high - low, middle = 0.5 * (low + high);
  solidLevel({middle.x(), middle.y(), low.z()}, 0.0, size.x(), size.y(), floor);
  solidLevel({middle.x(), middle.y(), high.z()}, 0.0, size.x(), size.y(), ceiling, false);
  solidUpright({middle.x(), high.y(), middle.z()}, -0.5 * M_PI, size.x(), size.z(), walls[0]);
  solidUpright({high.x(), middle.y(), middle.z()}, M_PI, size.y(), size.z(), walls[1]);
  solidUpright({middle.x(), low.y(), middle.z()}, 0.5 * M_PI, size.x(), size.z(), walls[2]);
  solidUpright({low.x(), middle.y(), middle.z()}, 0.0, size.y(), size.z(), walls[3]);
}

void SceneBuilder::lamp(const Vector3d& position, double size_m, double intensity,
                        const Vector3d& normal) {
  scene_.lights.push_back({position, normal.normalized(), size_m, intensity});
}

void SceneBuilder::repeatTurned(double yaw_rad) {
  const auto turn = [yaw_rad](const Vector3d& v) { return turned(yaw_rad, v.x(), v.y(), v.z()); };
  const std::vector<Surface> surfaces = scene_.surfaces;
  for (Surface s : surfaces) {
    s.origin = turn(s.origin);
    s.u_axis = turn(s.u_axis);
    s.v_axis = turn(s.v_axis);
    s.albedo = s.albedo.clone();
    scene_.surfaces.push_back(std::move(s));
  }
  const std::vector<Light> lights = scene_.lights;
  for (Light light : lights) {
    light.position = turn(light.position);
    light.normal = turn(light.normal);
    scene_.lights.push_back(light);
  }
}

void SceneBuilder::sky(const Vector3d& middle, double distance_m, double height_m) {
  const Paint paint = [](const Canvas& c) { return paintSky(c); };
  for (int i = 0; i < 4; ++i) {
    const double angle = 0.5 * M_PI * i;
    upright(middle + turned(angle, distance_m, 0, 0.45 * height_m), angle + M_PI, 2.0 * distance_m,
            height_m, i == 1 ? Paint([](const Canvas& c) { return paintLandscape(c); }) : paint,
            1.0);
  }
  level(middle + Vector3d(0, 0, 0.9 * height_m), 0.0, 2.0 * distance_m, 2.0 * distance_m, paint,
        false, 1.0);
}

void SceneBuilder::start(const Vector3d& position, double heading_rad, double pitch_rad,
                         const Vector3d& reach_min, const Vector3d& reach_max, double size_m) {
  const Vector3d ahead = turned(heading_rad, 1, 0, 0);
  const Vector3d z = std::cos(pitch_rad) * ahead - std::sin(pitch_rad) * Vector3d::UnitZ();
  const Vector3d x = turned(heading_rad, 0, -1, 0);
  Stage& stage = scene_.stage;
  stage.T_world_start.linear() << x, z.cross(x), z;
  stage.T_world_start.translation() = position;
  stage.reach_min_m = reach_min;
  stage.reach_max_m = reach_max;
  stage.size_m = size_m;
}

Scene SceneBuilder::finish() {
  checkScene(scene_);
  bakeLight(scene_);
  return std::move(scene_);
}

}  // namespace active_matching_slam
