#include <cmath>

#include "scene_builder.h"

namespace active_matching_slam {
namespace {

using Eigen::Vector3d;
using Paint = SceneBuilder::Paint;

}  // namespace

Scene makeCorridor(std::uint64_t seed) {
  SceneBuilder b("corridor", seed);
  constexpr double kLength = 24.0;
  b.scene().ambient = 0.7;
  b.scene().light_grid_m = 0.2;
  b.density(160);
  b.room({-1.2, -1.0, 0.0}, {1.2, kLength, 2.6},
         [](const Canvas& c) { return paintTiles(c, 0.4, 0.42); }, plaster(0.8),
         {paintDoor, plaster(0.66), plaster(0.66), paintBricks});
  b.density(320);
  for (int i = 0; i < 7; ++i) {
    const double y = 0.9 + 3.1 * i;
    const auto across = [&](double offset) { return y + offset + b.random().uniform(-0.2, 0.2); };
    b.upright({1.195, across(0.0), 1.6}, M_PI, 0.6, 0.85, paintPoster);
    b.upright({1.195, across(0.9), 1.55}, M_PI, 0.7, 0.5, paintCorkBoard);
    b.upright({1.195, across(2.0), 1.02}, M_PI, 0.9, 2.04, paintDoor);
    b.upright({-1.195, across(0.4), 1.55}, 0.0, 0.8, 0.6, paintPoster);
    b.upright({-1.195, across(1.7), 1.6}, 0.0, 0.5, 0.7, paintPoster);
    b.level({0, y + 0.5, 2.595}, 0.0, 0.3, 1.2, plain(0.95), false, 1.0);
    b.lamp({0, y + 0.5, 2.55}, 0.6, 1.1);
  }
  b.start({0.0, 0.0, 1.5}, 0.5 * M_PI, 0.05, {-0.5, -0.3, -0.4}, {0.5, 0.3, 16.0}, 1.0);
  return b.finish();
}

Scene makeCorridorEnd(std::uint64_t seed) {
  SceneBuilder b("corridor_end", seed);
  constexpr double kEnd = 3.4, kHalfWidth = 1.2;
  b.scene().ambient = 0.7;
  b.scene().light_grid_m = 0.2;
  b.density(160);
  b.room({-kHalfWidth, -6.0, 0.0}, {kHalfWidth, kEnd, 2.6},
         [](const Canvas& c) { return paintTiles(c, 0.4, 0.42); }, plaster(0.8),
         {plaster(0.7), plaster(0.66), plaster(0.66), plaster(0.66)});
  b.density(400);
  for (const double side : {-1.0, 1.0}) {
    for (int i = 0; i < 5; ++i) {
      for (int row = 0; row < 3; ++row) {
        const Paint paint = b.random().uniform() < 0.7 ? Paint(paintPoster) : Paint(paintCorkBoard);
        const double y = -0.8 + 0.75 * i + b.random().uniform(-0.05, 0.05);
        const double z = 0.75 + 0.65 * row + b.random().uniform(-0.05, 0.05);
        const double width = b.random().uniform(0.45, 0.62);
        b.upright({side * (kHalfWidth - 0.005), y, z}, side > 0.0 ? M_PI : 0.0, width,
                  b.random().uniform(0.4, 0.52), paint);
      }
    }
  }
  for (const double y : {-2.0, 0.5}) b.lamp({0, y, 2.55}, 0.6, 1.1);
  b.start({0.0, 0.0, 1.5}, 0.5 * M_PI, 0.0, {-0.5, -0.3, -0.4}, {0.5, 0.3, 0.8}, 1.0);
  return b.finish();
}

Scene makeWall(std::uint64_t seed) {
  SceneBuilder b("wall", seed);
  b.scene().ambient = 0.8;
  b.scene().light_grid_m = 0.25;
  constexpr double kLength = 28.0, kMiddle = 0.5 * kLength - 8.0;
  b.density(1);
  b.sky({kMiddle, 0, 0}, 100, 60);
  b.density(220);
  b.upright({kMiddle, 2.0, 1.6}, -0.5 * M_PI, kLength, 4.0, paintBricks);
  b.level({kMiddle, -0.5, -0.4}, 0.0, kLength, 5.0,
          [](const Canvas& c) { return paintTiles(c, 0.5, 0.5); });
  b.density(400);
  for (double x = -6.5; x < kLength - 9.0; x += b.random().uniform(1.0, 1.7)) {
    const double w = b.random().uniform(0.5, 0.9), h = b.random().uniform(0.5, 0.95);
    b.upright({x, 1.995, b.random().uniform(1.15, 1.9)}, -0.5 * M_PI, w, h,
              b.random().uniform() < 0.7 ? Paint(paintPoster) : Paint(paintCorkBoard));
  }
  b.lamp({kMiddle, -30, 30}, 1.0, 1900.0, {0.0, 1.0, -1.0});
  b.start({0.0, 0.0, 1.5}, 0.5 * M_PI, 0.0, {-1.0, -0.4, -0.5}, {12.0, 0.4, 0.6}, 1.0);
  return b.finish();
}

Scene makeWalkway(std::uint64_t seed) {
  SceneBuilder b("walkway", seed);
  b.scene().ambient = 1.0;
  b.scene().light_grid_m = 0.5;
  b.scene().occlusion_range_m = 2.0;
  b.density(4);
  b.sky({0, 20, 0}, 100, 90);
  b.density(90);
  b.level({0, 25, 0}, 0.0, 4.0, 60, [](const Canvas& c) { return paintTiles(c, 0.6, 0.5); });
  b.level({-7, 25, 0.002}, 0.0, 10.0, 60, paintGrass);
  b.level({7, 40, -0.01}, 0.0, 12.0, 100, paintGrass);
  b.upright({-5.0, 22, 4.5}, 0.0, 50, 9, paintFacade);
  b.upright({4.6, 22, 1.2}, M_PI, 50, 2.4, paintFoliage);
  b.density(220);
  // A colonnade: the same pillar over and over.
  for (int i = 0; i < 12; ++i) {
    const double y = 1.5 + 3.0 * i;
    b.box({2.2, y, 0}, 0.0, {0.4, 0.4, 3.0}, paintConcrete);
    if (i % 3 == 1)
      b.box({-2.2, y, 0}, 0.0, {1.4, 0.45, 0.45},
            [](const Canvas& c) { return paintWood(c, 0.4, 0.11); });
    if (i % 3 == 2)
      b.box(
          {-2.4, y, 0}, 0.0, {0.8, 0.8, 0.6}, [](const Canvas& c) { return paintStone(c, 0.12); },
          [](const Canvas& c) { return paintStone(c, 0.12); }, paintFoliage);
  }
  b.density(90);
  b.box({2.2, 18.0, 3.0}, 0.0, {0.7, 36.0, 0.4}, paintConcrete, true);
  b.density(250);
  for (int i = 0; i < 4; ++i) b.upright({-4.99, 5.0 + 7.2 * i, 1.1}, 0.0, 1.1, 2.2, paintDoor);
  b.lamp({20, -12, 40}, 1.0, 1900.0, {-0.4, 0.4, -1.0});
  b.start({0.0, 0.0, 1.6}, 0.5 * M_PI, 0.0, {-0.8, -0.4, -0.6}, {0.8, 0.4, 22.0}, 1.3);
  return b.finish();
}

}  // namespace active_matching_slam
