#include <cmath>

#include "scene_builder.h"

namespace active_matching_slam {
namespace {

using Eigen::Vector3d;
using Paint = SceneBuilder::Paint;

/// Facing of an upright rectangle that is seen when looking along the named direction.
constexpr double kSeenLookingNorth = -0.5 * M_PI;  // +y
constexpr double kSeenLookingEast = M_PI;          // +x
constexpr double kSeenLookingSouth = 0.5 * M_PI;
constexpr double kSeenLookingWest = 0.0;

Paint wood(double level, double plank_m = 0.0) {
  return [=](const Canvas& c) { return paintWood(c, level, plank_m); };
}
Paint fabric(double level) {
  return [level](const Canvas& c) { return paintFabric(c, level); };
}

/// A framed picture: a thin box, so it stands off the wall.
void frame(SceneBuilder& b, const Vector3d& centre, double facing, double w, double h,
           const Paint& picture) {
  const double yaw = facing + 0.5 * M_PI;
  const Vector3d out(std::cos(facing), std::sin(facing), 0.0);
  b.box(centre + 0.012 * out - Vector3d(0, 0, 0.5 * h), yaw, {w, 0.024, h}, picture, plain(0.12),
        plain(0.12), true);
}

void mug(SceneBuilder& b, const Vector3d& base, double level) {
  b.prism(
      base, 0.042, 0.10, 10, [level](const Canvas& c) { return paintPlain(c, level); },
      plain(0.08));
}

/// What lies about on a desk of width w; `top` is the middle of its surface.
void clutter(SceneBuilder& b, const Vector3d& top, double w) {
  const auto at = [&](double x, double y) { return Vector3d(top + Vector3d(x * w, y, 0.0015)); };
  b.monitor(top + Vector3d(-0.02 * w, 0.2, 0), 0.06, 0.56);
  b.box(top + Vector3d(-0.03 * w, -0.14, 0), 0.05, {0.42, 0.14, 0.022}, plain(0.15), plain(0.15),
        paintKeyboard);
  b.level(at(0.28, -0.16), 0.3, 0.21, 0.297, paintPage);
  b.level(at(0.30, -0.13) + Vector3d(0, 0, 0.001), -0.15, 0.21, 0.297, paintPage);
  b.level(at(-0.33, -0.2), -0.35, 0.21, 0.297, paintPage);
  b.pile(top + Vector3d(0.38 * w, 0.16, 0), 0.2, 4, 0.22, 0.29, paintBookCover);
  b.pile(top + Vector3d(-0.4 * w, 0.17, 0), -0.2, 2, 0.2, 0.26, paintBookCover);
  mug(b, top + Vector3d(0.2 * w, 0.03, 0), 0.7);
  b.prism(top + Vector3d(-0.25 * w, 0.02, 0), 0.04, 0.12, 8, paintBookCover, plain(0.1));
  b.box(top + Vector3d(0.25 * w, 0.24, 0), 0.4, {0.16, 0.12, 0.11}, paintPackage);
}

}  // namespace

Scene makeRoom(std::uint64_t seed) {
  SceneBuilder b("room", seed);
  b.scene().ambient = 0.62;
  b.density(300);
  b.room({-2.4, -2.0, 0.0}, {2.4, 2.2, 2.6}, wood(0.46, 0.14), plaster(0.8),
         {paintWallpaper, plaster(0.66), plaster(0.66), paintBricks});
  b.density(500);
  b.level({0.1, 0.35, 0.004}, 0.04, 2.2, 1.5, paintCarpet);
  b.density(560);
  // North: desk, pictures above it, bookcase, boxes.
  b.table({0.1, 1.78, 0}, 0.0, {1.6, 0.72, 0.74}, 0.58);
  clutter(b, {0.1, 1.78, 0.74}, 1.6);
  b.chair({0.35, 1.15, 0}, 2.7);
  b.bookcase({-1.62, 2.05, 0}, 0.0, 1.2, 2.0, 5);
  frame(b, {-0.42, 2.2, 1.75}, kSeenLookingNorth, 0.5, 0.7, paintPoster);
  frame(b, {0.25, 2.2, 1.82}, kSeenLookingNorth, 0.62, 0.46, paintPoster);
  frame(b, {0.92, 2.2, 1.66}, kSeenLookingNorth, 0.42, 0.6, paintPoster);
  b.upright({1.4, 2.197, 1.5}, kSeenLookingNorth, 0.3, 0.45, paintCalendar);
  b.box({1.95, 1.82, 0}, 0.1, {0.6, 0.5, 0.45}, paintPackage);
  b.box({1.9, 1.86, 0.45}, -0.3, {0.42, 0.36, 0.32}, paintPackage);
  b.box({1.35, 1.93, 0}, 0.2, {0.32, 0.3, 0.28}, paintPackage);
  // East: window, cork board, armchair.
  b.upright({2.39, 0.55, 1.55}, kSeenLookingEast, 1.3, 1.25, paintWindow, 0.75);
  b.upright({2.395, -0.75, 1.5}, kSeenLookingEast, 0.9, 0.7, paintCorkBoard);
  b.box({1.75, 0.75, 0.0}, -0.9, {0.75, 0.7, 0.42}, fabric(0.4));
  b.box({1.97, 0.95, 0.42}, -0.9, {0.72, 0.16, 0.45}, fabric(0.42));
  b.box({1.7, 0.72, 0.42}, -1.3, {0.4, 0.38, 0.1}, paintWallpaper);
  // West: posters on bricks, a sideboard.
  b.box({-2.15, 0.4, 0}, 0.5 * M_PI, {1.4, 0.42, 0.78}, paintDoor, wood(0.5), wood(0.56));
  b.pile({-2.15, 0.8, 0.78}, 1.4, 5, 0.24, 0.3, paintBookCover);
  b.box({-2.15, 0.1, 0.78}, 1.8, {0.3, 0.2, 0.22}, paintPackage);
  mug(b, {-2.02, 0.45, 0.78}, 0.85);
  frame(b, {-2.4, 0.75, 1.65}, kSeenLookingWest, 0.6, 0.8, paintPoster);
  frame(b, {-2.4, -0.05, 1.6}, kSeenLookingWest, 0.7, 0.5, paintPoster);
  frame(b, {-2.4, -1.0, 1.6}, kSeenLookingWest, 0.5, 0.7, paintPoster);
  // South: behind the camera at the start.
  b.upright({-1.2, -1.995, 1.0}, kSeenLookingSouth, 0.9, 2.0, paintDoor);
  frame(b, {0.6, -2.0, 1.6}, kSeenLookingSouth, 0.9, 0.65, paintPoster);
  b.bookcase({1.7, -1.84, 0}, M_PI, 1.0, 1.2, 3);
  // A low table in front.
  b.table({-0.55, 0.72, 0}, 0.25, {0.85, 0.5, 0.42}, 0.4);
  b.pile({-0.75, 0.72, 0.42}, 0.5, 3, 0.22, 0.28, paintBookCover);
  mug(b, {-0.42, 0.78, 0.42}, 0.75);
  b.level({-0.4, 0.62, 0.4212}, 0.9, 0.21, 0.297, paintPage);
  b.level({0.3, 0.2, 2.595}, 0.0, 0.5, 0.5, plain(0.95), false, 1.2);
  b.lamp({0.3, 0.2, 2.5}, 0.5, 1.7);
  b.lamp({2.3, 0.55, 1.6}, 0.9, 1.3, {-1.0, 0.0, -0.2});
  b.start({0.0, -0.75, 1.4}, 0.5 * M_PI, 0.16, {-0.9, -0.35, -0.5}, {0.9, 0.35, 0.7}, 1.0);
  return b.finish();
}

Scene makeOffice(std::uint64_t seed) {
  SceneBuilder b("office", seed);
  b.scene().ambient = 0.75;
  b.scene().light_grid_m = 0.16;
  b.density(200);
  b.room(
      {-4.0, -3.0, 0.0}, {4.0, 6.0, 2.9}, [](const Canvas& c) { return paintTiles(c, 0.5, 0.34); },
      [](const Canvas& c) { return paintTiles(c, 0.6, 0.82); },
      {plaster(0.7), plaster(0.72), plaster(0.7), paintConcrete});
  b.density(450);
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 2; ++column) {
      const double x = -1.5 + 2.6 * column, y = 1.6 + 2.3 * row;
      b.table({x, y, 0}, 0.0, {1.6, 0.76, 0.74}, 0.66);
      clutter(b, {x, y, 0.74}, 1.6);
      b.box({x, y + 0.44, 0}, 0.0, {1.9, 0.05, 1.15}, fabric(0.38 + 0.1 * column));
      b.upright({x + 0.55, y + 0.41, 0.98}, kSeenLookingNorth, 0.4, 0.26, paintCorkBoard);
      b.chair({x + 0.2, y - 0.65, 0}, 2.8 + 0.5 * column);
    }
  b.bookcase({-3.83, 1.0, 0}, 0.5 * M_PI, 1.3, 2.0, 5);
  b.bookcase({-3.83, 2.6, 0}, 0.5 * M_PI, 1.3, 2.0, 5);
  b.box({3.0, 2.3, 0}, 0.0, {0.45, 0.45, 2.9}, paintConcrete);
  b.box({3.5, 1.1, 0}, 0.0, {0.5, 0.6, 1.3}, plain(0.55));
  b.box({3.3, 3.6, 0}, 0.4, {0.5, 0.4, 0.35}, paintPackage);
  b.box({3.35, 3.62, 0.35}, 0.1, {0.4, 0.35, 0.3}, paintPackage);
  for (int i = 0; i < 3; ++i)
    b.upright({-2.6 + 2.4 * i, 5.99, 1.65}, kSeenLookingNorth, 1.6, 1.3, paintWindow, 0.8);
  frame(b, {4.0, 2.0, 1.7}, kSeenLookingEast, 0.9, 1.2, paintPoster);
  frame(b, {4.0, 4.0, 1.7}, kSeenLookingEast, 1.3, 0.9, paintPoster);
  b.upright({3.99, 0.0, 1.5}, kSeenLookingEast, 1.8, 1.0, paintCorkBoard);
  frame(b, {-4.0, 4.3, 1.7}, kSeenLookingWest, 0.9, 1.2, paintPoster);
  for (double x : {-1.5, 1.5})
    for (double y : {0.6, 3.6}) {
      b.level({x, y, 2.895}, 0.0, 0.6, 0.6, plain(0.95), false, 1.0);
      b.lamp({x, y, 2.85}, 0.6, 1.6);
    }
  b.start({0.0, -0.9, 1.55}, 0.5 * M_PI, 0.15, {-1.2, -0.4, -0.9}, {1.2, 0.4, 0.9}, 1.2);
  return b.finish();
}

Scene makeDesk(std::uint64_t seed) {
  SceneBuilder b("desk", seed);
  b.scene().ambient = 0.6;
  b.scene().light_grid_m = 0.05;
  b.scene().occlusion_range_m = 0.4;
  b.density(400);
  b.room({-1.4, -1.8, 0.0}, {1.4, 0.85, 2.4}, wood(0.4, 0.12), plaster(0.8),
         {paintWallpaper, plaster(0.62), plaster(0.62), paintBricks});
  b.density(1300);
  b.table({0, 0.4, 0}, 0.0, {1.7, 0.85, 0.74}, 0.55);
  clutter(b, {0.0, 0.38, 0.74}, 1.5);
  b.level({0.05, 0.08, 0.7412}, -0.5, 0.21, 0.297, paintPage);
  b.pile({-0.3, 0.15, 0.74}, 0.7, 2, 0.16, 0.22, paintBookCover);
  b.box({0.47, 0.2, 0.74}, 0.8, {0.13, 0.09, 0.06}, paintPackage);
  frame(b, {-0.5, 0.85, 1.35}, kSeenLookingNorth, 0.42, 0.55, paintPoster);
  b.upright({0.42, 0.847, 1.3}, kSeenLookingNorth, 0.6, 0.45, paintCorkBoard);
  b.lamp({0.5, -0.4, 2.2}, 0.4, 1.3);
  b.lamp({-1.2, 0.2, 1.6}, 0.3, 0.45, {1.0, 0.2, -0.5});
  b.start({0.0, -0.42, 1.28}, 0.5 * M_PI, 0.55, {-0.4, -0.15, -0.3}, {0.4, 0.15, 0.3}, 0.4);
  return b.finish();
}

Scene makeCheckerboard(std::uint64_t seed) {
  SceneBuilder b("checkerboard", seed);
  b.scene().ambient = 0.6;
  b.scene().light_grid_m = 0.05;
  b.density(400);
  b.room({-1.5, -1.5, 0.0}, {1.5, 1.5, 2.4}, wood(0.45, 0.14), plaster(0.8),
         {paintBricks, plaster(0.66), plaster(0.66), paintBricks});
  b.density(1000);
  b.level({0.0, 0.25, 0.003}, 0.0, 0.96, 0.72,
          [](const Canvas& c) { return paintCheckerboard(c, 0.04); });
  b.lamp({0.4, 0.0, 2.2}, 0.5, 1.3);
  b.start({0.0, -0.35, 0.62}, 0.5 * M_PI, 0.8, {-0.3, -0.15, -0.25}, {0.3, 0.12, 0.25}, 0.3);
  return b.finish();
}

Scene makeTwoDepths(std::uint64_t seed) {
  SceneBuilder b("two_depths", seed);
  b.scene().ambient = 0.75;
  b.scene().light_grid_m = 0.16;
  b.density(110);
  b.room({-8.0, -1.5, 0.0}, {8.0, 12.0, 6.0}, wood(0.4, 0.2), plaster(0.75),
         {plaster(0.6), plaster(0.6), plaster(0.6), plaster(0.6)});
  for (int i = 0; i < 7; ++i)
    for (int row = 0; row < 3; ++row)
      b.upright({-6.3 + 2.1 * i + 0.3 * b.random().uniform(-1, 1), 11.995,
                 1.1 + 1.7 * row + 0.15 * b.random().uniform(-1, 1)},
                kSeenLookingNorth, b.random().uniform(1.1, 1.7), b.random().uniform(1.1, 1.4),
                b.random().uniform() < 0.7 ? Paint(paintPoster) : Paint(paintCorkBoard));
  // Small things half a metre off; they rise before the wall, so that near and far lie side by side
  // in the image.
  b.density(1850);
  b.table({0, 0.31, 0}, 0.0, {1.33, 0.56, 0.8}, 0.5);
  for (int i = 0; i < 5; ++i) {
    const double x = -0.448 + 0.224 * i + 0.021 * b.random().uniform(-1, 1);
    const double y = 0.275 + 0.056 * b.random().uniform(-1, 1);
    const double yaw = b.random().uniform(-0.4, 0.4);
    b.box({x, y, 0.8}, yaw, {0.14, 0.105, 0.14}, paintPoster);
    if (i % 2 == 0)
      b.box({x, y, 0.94}, yaw + 0.2, {0.112, 0.084, 0.14}, paintPoster);
    else
      b.pile({x, y, 0.94}, yaw, 3, 0.105, 0.084, paintBookCover);
  }
  for (int i = 0; i < 5; ++i)
    b.level({-0.35 + 0.175 * i, 0.135, 0.8012 + 0.0004 * i}, b.random().uniform(-0.5, 0.5), 0.148,
            0.21, paintPage);
  for (double x : {-3.0, 3.0}) b.lamp({x, 7.5, 5.8}, 0.8, 14.0, {0.0, 0.8, -1.0});
  b.lamp({0.0, -0.4, 3.0}, 0.6, 5.0, {0.0, 0.3, -1.0});
  b.start({0.0, -0.25, 1.08}, 0.5 * M_PI, 0.1, {-0.28, -0.1, -0.14}, {0.28, 0.1, 0.14}, 0.28);
  return b.finish();
}

}  // namespace active_matching_slam
