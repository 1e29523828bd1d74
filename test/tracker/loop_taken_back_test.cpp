// A loop that is closed at the wrong place is taken back, and the map is as before.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iostream>

#include "active_matching_slam/map/map_file.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

TrackerOptions loopOptions() {
  TrackerOptions options;
  options.submap_filter.enabled = true;
  options.map.features_per_frame = 30;
  options.map.maximum_features = 80;
  return options;
}

/// Along a corridor. The way back is the same in reverse.
const Film& corridorFilm() {
  static const Film film = [] {
    SimulatorOptions options = filmOptions(16.0);
    options.scene = "corridor_loop";
    options.motion = "loop";
    options.rate_hz = 15.0;
    return makeFilm(options);
  }();
  return film;
}

/// As if what it holds had been carried elsewhere while out of view: where it is found again, the
/// camera seems to be elsewhere.
void carryAway(std::size_t submap, const Eigen::Vector3d& by, MapFileContent* map) {
  Conditional& points = map->submaps[submap].points;
  for (Eigen::Index row = 0; row < points.mean.size(); row += 3) points.mean.segment<3>(row) += by;
  for (MapFeature& feature : map->frozen)
    if (std::count(points.ids.begin(), points.ids.end(), feature.id) > 0)
      feature.patch.T_world_camera.translation() += by;
}

/// Bit for bit.
bool sameSubmaps(const MapFileContent& a, const MapFileContent& b) {
  bool same = a.submaps.size() == b.submaps.size() && a.frozen.size() == b.frozen.size() &&
              a.next_submap == b.next_submap && a.trunk.ids == b.trunk.ids &&
              a.trunk.Q == b.trunk.Q;
  for (std::size_t i = 0; same && i < a.submaps.size(); ++i) {
    const Conditional &p = a.submaps[i].points, &q = b.submaps[i].points;
    same = a.submaps[i].id == b.submaps[i].id && a.submaps[i].lost_bits == b.submaps[i].lost_bits &&
           p.ids == q.ids && p.given_ids == q.given_ids && p.mean == q.mean &&
           p.given_mean == q.given_mean && p.K == q.K && p.Q == q.Q;
  }
  for (std::size_t i = 0; same && i < a.frozen.size(); ++i)
    same = a.frozen[i].id == b.frozen[i].id && a.frozen[i].successes == b.frozen[i].successes &&
           a.frozen[i].patch.T_world_camera.matrix() == b.frozen[i].patch.T_world_camera.matrix();
  return same;
}

TEST(LoopTakenBack, AWrongLoopIsTakenBackAndTheMapIsAsBefore) {
  const Film& film = corridorFilm();
  const int count = static_cast<int>(film.frames.size());
  Tracker there(film.camera, loopOptions());
  const Frames way = trackFrames(film, &there, 0, count);
  const std::string path =
      testing::TempDir() + "/loop_taken_back_" + std::to_string(::getpid()) + ".map";
  there.saveMap(path);
  MapFileContent map = readMapFile(path);
  ASSERT_GE(map.submaps.size(), 4u);
  carryAway(map.submaps.size() - 1, Eigen::Vector3d(0.0, 0.0, std::getenv("D") ? std::atof(std::getenv("D")) : 0.25), &map);
  writeMapFile(path, map);

  Tracker back(film.camera, loopOptions());
  back.loadMap(path);
  double stamp_s = film.frames.back().stamp_s;
  MapFileContent before, after;
  int closed = -1, taken_back = -1, loops = 0;
  std::shared_ptr<const TrackedFrame> frame;
  for (int i = count - 1; i >= 0; --i) {
    frame = back.track(film.frames[i].image, stamp_s += 1.0 / 15.0);
    ASSERT_TRUE(isFinite(*frame));
    if (frame->loops > loops && closed < 0) closed = i;
    if (frame->loops < loops && taken_back < 0) {
      taken_back = i;
      back.saveMap(path);
      after = readMapFile(path);
      EXPECT_EQ(frame->state, TrackingState::kLost);
    }
    if (closed < 0 && frame->state == TrackingState::kTracking) {
      back.saveMap(path);
      before = readMapFile(path);
    }
    if (frame->loops != loops || !frame->reason.empty())
      std::cout << i << ": loops " << frame->loops << ", jump "
                << frame->map_jump.translation().norm() << ", " << frame->reason << "\n";
    loops = frame->loops;
  }
  std::filesystem::remove(path);
  ASSERT_GE(closed, 0) << "no loop was closed";
  ASSERT_GE(taken_back, 0) << "the wrong loop was not taken back";
  EXPECT_TRUE(sameSubmaps(before, after));
  EXPECT_EQ(loops, 0);
}

}  // namespace
}  // namespace active_matching_slam
