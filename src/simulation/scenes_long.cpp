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

Scene makePlanks(std::uint64_t seed) {
  SceneBuilder b("planks", seed);
  constexpr double kLength = 24.0;
  b.scene().ambient = 0.7;
  b.scene().light_grid_m = 0.2;
  b.density(160);
  const auto boards = [](double level, double plank_m) {
    return [level, plank_m](const Canvas& c) { return paintWood(c, level, plank_m); };
  };
  b.room({-1.2, -1.0, 0.0}, {1.2, kLength, 2.6}, boards(0.45, 0.2), plaster(0.8),
         {boards(0.6, 0.15), boards(0.6, 0.15), boards(0.5, 0.3), boards(0.55, 0.1)});
  for (int i = 0; i < 7; ++i) {
    const double y = 1.4 + 3.1 * i;
    b.level({0, y, 2.595}, 0.0, 0.3, 1.2, plain(0.95), false, 1.0);
    b.lamp({0, y, 2.55}, 0.6, 1.1);
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

Scene makeCorridorLoop(std::uint64_t seed) {
  SceneBuilder b("corridor_loop", seed);
  constexpr double kHalf = 6.0, kInner = 4.0, kRadius = 5.0, kHeight = 2.6;
  b.scene().ambient = 0.7;
  b.scene().light_grid_m = 0.25;
  b.density(110);
  b.room({-kHalf, -kHalf, 0.0}, {kHalf, kHalf, kHeight},
         [](const Canvas& c) { return paintTiles(c, 0.4, 0.42); }, plaster(0.8),
         {paintBricks, plaster(0.66), plaster(0.7), plaster(0.62)});
  b.prism({0.0, 0.0, 0.0}, kInner, kHeight, 12, plaster(0.6), plain(0.5));
  b.density(300);
  // On the outer walls, and on the twelve sides of the inner one.
  for (int wall = 0; wall < 4; ++wall) {
    const double facing = 0.5 * M_PI * wall;  // the wall stands where this points from
    const Eigen::Rotation2Dd turn(facing);
    for (double along = -5.2; along < 5.3; along += b.random().uniform(0.9, 1.3)) {
      const Eigen::Vector2d at = turn * Eigen::Vector2d(-(kHalf - 0.005), along);
      const double u = b.random().uniform();
      const Paint paint = u < 0.5   ? Paint(paintPoster)
                          : u < 0.8 ? Paint(paintCorkBoard)
                                    : paintDoor;
      const bool is_door = u >= 0.8;
      b.upright({at.x(), at.y(), is_door ? 1.02 : b.random().uniform(1.3, 1.7)}, facing,
                is_door ? 0.9 : b.random().uniform(0.45, 0.8),
                is_door ? 2.04 : b.random().uniform(0.4, 0.8), paint);
    }
  }
  const double apothem = kInner * std::cos(M_PI / 12.0);
  for (int side = 0; side < 12; ++side) {
    const double facing = 2.0 * M_PI * (side + 0.5) / 12.0;
    const Eigen::Rotation2Dd turn(facing);
    for (const double along : {-0.5, 0.5}) {
      const Eigen::Vector2d at = turn * Eigen::Vector2d(apothem + 0.005, along);
      b.upright({at.x(), at.y(), b.random().uniform(1.2, 1.8)}, facing,
                b.random().uniform(0.4, 0.7), b.random().uniform(0.4, 0.8),
                b.random().uniform() < 0.7 ? Paint(paintPoster) : Paint(paintCorkBoard));
    }
    const Eigen::Vector2d above = turn * Eigen::Vector2d(kRadius, 0.0);
    b.level({above.x(), above.y(), kHeight - 0.005}, facing, 0.3, 1.0, plain(0.95), false, 1.0);
    b.lamp({above.x(), above.y(), kHeight - 0.05}, 0.5, 0.9);
  }
  // Once round, to the right, about a middle that lies to the right.
  b.start({0.0, kRadius, 1.5}, 0.0, 0.05, {-0.5, -0.3, -0.5}, {0.5, 0.3, 1.5}, 1.0);
  b.scene().stage.loop_radius_m = kRadius;
  return b.finish();
}

Scene makeRooms(std::uint64_t seed) {
  SceneBuilder b("rooms", seed);
  constexpr double kHalf = 6.0, kRadius = 3.4, kHeight = 2.6, kDoor = 0.8, kLintel = 2.1,
                   kThickness = 0.15;
  b.scene().ambient = 0.7;
  b.scene().light_grid_m = 0.25;
  /// From the middle outwards, with a door where the camera goes through.
  const auto buildWall = [&](double yaw) {
    b.density(110);
    const Eigen::Rotation2Dd turn(yaw);
    const auto part = [&](double from, double to, double low, double high) {
      const Eigen::Vector2d middle = turn * Eigen::Vector2d(0.5 * (from + to), 0.0);
      b.box({middle.x(), middle.y(), low}, yaw, {to - from, kThickness, high - low}, plaster(0.72),
            low > 0.0);
    };
    part(0.0, kRadius - kDoor, 0.0, kHeight);
    part(kRadius + kDoor, kHalf, 0.0, kHeight);
    part(kRadius - kDoor, kRadius + kDoor, kLintel, kHeight);
  };
  /// A quarter of the whole; its outer walls are those that it sees from within.
  const auto buildRoom = [&](double yaw, const Paint& ahead, const Paint& aside) {
    b.density(110);
    const Eigen::Rotation2Dd turn(yaw);
    const auto place = [&](double x, double y, double z) {
      const Eigen::Vector2d at = turn * Eigen::Vector2d(x, y);
      return Vector3d(at.x(), at.y(), z);
    };
    b.solidLevel(place(0.5 * kHalf, 0.5 * kHalf, 0.0), yaw, kHalf, kHalf,
                 [](const Canvas& c) { return paintTiles(c, 0.5, 0.45); });
    b.solidLevel(place(0.5 * kHalf, 0.5 * kHalf, kHeight), yaw, kHalf, kHalf, plaster(0.8), false);
    b.solidUpright(place(kHalf, 0.5 * kHalf, 0.5 * kHeight), yaw + M_PI, kHalf, kHeight, ahead);
    b.solidUpright(place(0.5 * kHalf, kHalf, 0.5 * kHeight), yaw - 0.5 * M_PI, kHalf, kHeight,
                   aside);
    b.density(300);
    for (double along = 0.8; along < 5.4; along += b.random().uniform(0.8, 1.2)) {
      b.upright(place(kHalf - 0.005, along, b.random().uniform(1.2, 1.8)), yaw + M_PI,
                b.random().uniform(0.45, 0.8), b.random().uniform(0.4, 0.8), paintPoster);
      b.upright(place(along, kHalf - 0.005, b.random().uniform(1.2, 1.8)), yaw - 0.5 * M_PI,
                b.random().uniform(0.45, 0.8), b.random().uniform(0.4, 0.8),
                b.random().uniform() < 0.5 ? Paint(paintPoster) : Paint(paintCorkBoard));
    }
    for (const double along : {0.9, 1.8}) {  // on the walls between rooms, beside the doors
      constexpr double kFace = 0.5 * kThickness + 0.005;
      b.upright(place(along, kFace, b.random().uniform(1.2, 1.8)), yaw + 0.5 * M_PI,
                b.random().uniform(0.4, 0.6), b.random().uniform(0.4, 0.8), paintPoster);
      b.upright(place(kFace, along, b.random().uniform(1.2, 1.8)), yaw,
                b.random().uniform(0.4, 0.6), b.random().uniform(0.4, 0.8), paintPoster);
    }
    b.bookcase(place(5.0, 5.6, 0.0), yaw, 1.0, 1.9, 5);
    b.table(place(1.3, 1.2, 0.0), yaw, {1.2, 0.8, 0.75}, 0.5);
    b.pile(place(1.3, 1.2, 0.75), yaw + 0.3, 4, 0.3, 0.25, paintPoster);
    b.lamp(place(2.6, 2.6, kHeight - 0.05), 0.6, 2.5);
    b.level(place(2.6, 2.6, kHeight - 0.005), yaw, 0.6, 0.6, plain(0.95), false, 1.0);
  };
  for (const double yaw : {0.0, 0.5 * M_PI}) buildWall(yaw);
  buildRoom(0.0, paintBricks, plaster(0.7));
  // The room opposite is the same once more, to the last poster, as in rows of rented rooms: only
  // what is seen through the doors tells them apart.
  b.repeatTurned(M_PI);
  buildRoom(0.5 * M_PI, plaster(0.66), plaster(0.64));
  buildRoom(1.5 * M_PI, plaster(0.68), plaster(0.62));
  const double a = 0.25 * M_PI;  // in the middle of a room, along the circle
  b.start({kRadius * std::cos(a), kRadius * std::sin(a), 1.5}, a - 0.5 * M_PI, 0.05,
          {-0.5, -0.3, -0.5}, {0.5, 0.3, 1.0}, 1.0);
  b.scene().stage.loop_radius_m = kRadius;
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
