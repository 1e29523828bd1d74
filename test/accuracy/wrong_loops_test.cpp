// Places that look the same are no loops: judged by the truth, and where there is none, by the
// camera's having been elsewhere.

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include "../../src/tracker/loop_finder.h"
#include "accuracy/recorded_run.h"
#include "active_matching_slam/map/map_file.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "active_matching_slam/submaps/submap_tree.h"

namespace active_matching_slam {
namespace test {
namespace {

using Eigen::Vector3d;

TrackerOptions smallMapWithSubmaps() {
  TrackerOptions options;
  options.submap_filter.enabled = true;
  options.map.features_per_frame = 25;
  options.map.maximum_features = 70;
  return options;
}

SimulatorOptions walk(const std::string& scene, const std::string& motion, double duration_s) {
  SimulatorOptions options;
  options.scene = scene;
  options.motion = motion;
  options.rate_hz = 12.0;
  options.duration_s = duration_s;
  options.width = 320;
  options.height = 240;
  options.exposure_ms = 4.0;
  return options;
}

struct Walk {
  std::vector<SimulatedFrame> film;
  std::vector<std::shared_ptr<const TrackedFrame>> frames;
};

/// Tracks a film as it is rendered, as long as `goes_on` says.
template <typename GoesOn>
Walk track(const SimulatorOptions& options, Tracker* tracker, Simulator* simulator,
           const GoesOn& goes_on) {
  Walk walk;
  while (auto frame = simulator->next()) {
    walk.frames.push_back(tracker->track(frame->image, frame->stamp_s));
    walk.film.push_back(*frame);
    if (!goes_on(walk)) break;
  }
  EXPECT_FALSE(walk.frames.empty()) << options.scene;
  return walk;
}

/// True metres from map units, by the first frames that were tracked.
Eigen::Matrix4d fitOfBeginning(const Walk& walk, double until_s) {
  std::vector<Vector3d> estimate, truth;
  for (std::size_t i = 0; i < walk.frames.size(); ++i) {
    if (walk.film[i].stamp_s - walk.film[0].stamp_s > until_s) break;
    if (walk.frames[i]->state != TrackingState::kTracking) continue;
    estimate.push_back(walk.frames[i]->camera.position_world);
    truth.push_back(walk.film[i].truth.T_world_camera.translation());
  }
  const auto count = static_cast<Eigen::Index>(estimate.size());
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    from.col(i) = estimate[static_cast<std::size_t>(i)];
    to.col(i) = truth[static_cast<std::size_t>(i)];
  }
  return Eigen::umeyama(from, to, true);
}

Vector3d inMetres(const Eigen::Matrix4d& fit, const Vector3d& position) {
  return (fit * position.homogeneous()).head<3>();
}

struct Loops {
  int closed = 0, wrong = 0;
};

/// A loop is wrong that puts the camera farther off than `limit_m`, more than drift does.
Loops loopsOf(const Walk& walk, double beginning_s, double limit_m) {
  const Eigen::Matrix4d fit = fitOfBeginning(walk, beginning_s);
  Loops loops;
  for (std::size_t i = 1; i < walk.frames.size(); ++i) {
    if (walk.frames[i]->loops <= walk.frames[i - 1]->loops) continue;
    ++loops.closed;
    const double off_m = (inMetres(fit, walk.frames[i]->camera.position_world) -
                          walk.film[i].truth.T_world_camera.translation())
                             .norm();
    if (off_m > limit_m) ++loops.wrong;
  }
  return loops;
}

int framesTracked(const Walk& walk) {
  return static_cast<int>(std::count_if(walk.frames.begin(), walk.frames.end(), [](const auto& f) {
    return f->state == TrackingState::kTracking;
  }));
}

TEST(WrongLoops, InACorridorThatRepeatsItselfThereAreNone) {
  const SimulatorOptions options = walk("corridor", "forward", 25.0);
  Simulator simulator(options);
  Tracker tracker(simulator.camera(), smallMapWithSubmaps());
  const Walk there_and_back =
      track(options, &tracker, &simulator, [](const Walk&) { return true; });
  const Loops loops = loopsOf(there_and_back, 5.0, 1.5);  // doors and posters stand 3.1 m apart
  std::cout << "loops " << loops.closed << ", wrong " << loops.wrong << ", submaps laid aside "
            << there_and_back.frames.back()->frozen->frozen << "\n";
  EXPECT_EQ(loops.wrong, 0);
  EXPECT_GE(there_and_back.frames.back()->frozen->frozen, 1);
  EXPECT_GE(framesTracked(there_and_back), 280);
}

/// Two rooms that are the same but for where they are: the camera goes from the first through
/// another into the second.
class RoomsAlike : public testing::Test {
 protected:
  RoomsAlike() { std::filesystem::create_directories(directory_); }
  ~RoomsAlike() override { std::filesystem::remove_all(directory_); }
  const std::string directory_ = testing::TempDir() + "/wrong_loops_" + std::to_string(::getpid());
};

TEST_F(RoomsAlike, AreNotTakenForOneAnother) {
  const SimulatorOptions options = walk("rooms", "loop", 34.0);  // once round takes 24 s
  Simulator simulator(options);
  Tracker tracker(simulator.camera(), smallMapWithSubmaps());
  const Walk round = track(options, &tracker, &simulator, [](const Walk&) { return true; });
  const Loops loops = loopsOf(round, 6.0, 3.0);  // rooms alike are 6.8 m apart
  const TrackedFrame& last = *round.frames.back();
  std::cout << "loops " << loops.closed << ", wrong " << loops.wrong << ", submaps laid aside "
            << last.frozen->frozen << ", found again " << last.frozen->found << ", lost "
            << last.times_lost << " times\n";
  EXPECT_EQ(loops.wrong, 0);
  EXPECT_GE(last.frozen->frozen, 2);
  const Eigen::Matrix4d fit = fitOfBeginning(round, 6.0);
  for (std::size_t i = 0; i < round.frames.size(); ++i) {
    if (round.frames[i]->state != TrackingState::kTracking || round.frames[i]->map != 0) continue;
    EXPECT_LT((inMetres(fit, round.frames[i]->camera.position_world) -
               round.film[i].truth.T_world_camera.translation())
                  .norm(),
              3.0)
        << i;
  }
}

TEST_F(RoomsAlike, FoolALookForTheCameraButNotItsGate) {
  const SimulatorOptions options = walk("rooms", "loop", 20.0);
  Simulator simulator(options);
  const CameraModel camera = simulator.camera();
  Tracker tracker(camera, smallMapWithSubmaps());
  const std::string path = directory_ + "/rooms.map";
  const RelocaliserOptions look;
  const Relocaliser relocaliser(look, MapOptions(), ImageOptions());
  int fooled = 0, refused = 0, confirmed = 0;
  LoopWitness witness;
  track(options, &tracker, &simulator, [&](const Walk& walk) {
    // Half way round the camera is in the second of the two.
    const double walked_s = walk.film.back().stamp_s - walk.film.front().stamp_s;
    if (walked_s < 9.0 || walk.frames.size() % 3 != 0) return true;
    const Eigen::Matrix4d fit = fitOfBeginning(walk, 6.0);
    tracker.saveMap(path);
    const MapFileContent map = readMapFile(path);
    Ekf filter{FilterOptions()};
    filter.restore(map.camera_state, map.features, map.covariance, map.next_id);
    SubmapTree tree;
    tree.restore(map.trunk, map.submaps, map.next_submap);
    std::map<FeatureId, const MapFeature*> kept;
    for (const MapFeature& feature : map.frozen) kept[feature.id] = &feature;
    for (const Leaf& leaf : map.submaps) {
      const Conditional points = tree.givenActive(activePoints(filter), leaf);
      const PointInsertion now = pointInsertion(filter, points);
      std::vector<Landmark> landmarks;
      for (const FeatureState& state : now.features)
        landmarks.push_back({kept.at(state.id), state});
      const auto found = relocaliser.find(camera.corrected(map.camera_state.lens),
                                          walk.film.back().image, landmarks);
      if (!found) continue;
      const double off_m = (inMetres(fit, found->T_world_camera.translation()) -
                            walk.film.back().truth.T_world_camera.translation())
                               .norm();
      if (off_m < 3.0) continue;
      ++fooled;
      const CameraOffset offset = offsetFromSubmap(filter, camera, points, *found);
      refused += !offset.isExpected();
      confirmed += witness.confirms(walk.frames.back()->index, filter.camera().poseWorldCamera(),
                                    *found, offset);
    }
    return true;
  });
  std::cout << "fooled " << fooled << " times, refused " << refused << ", confirmed " << confirmed
            << "\n";
  ASSERT_GE(fooled, 2) << "or the trap is none";
  EXPECT_EQ(refused, fooled);
  EXPECT_EQ(confirmed, 0) << "two looks at a room that looks the same agree, and are both wrong";
}

TEST(WrongLoops, OnTheRecordedCheckerboardThereAreNone) {
  if (recordedDataFolder().empty()) GTEST_SKIP() << "AMS_DATA is not set";
  RecordedRunOptions options;
  options.tracker = smallMapWithSubmaps();
  options.maximum_frames = 366;
  const RecordedRun run = trackRecording("uzh_vamr_checkerboard", options);
  const Trajectory truth = truthOf(run.name);
  int wrong = 0, closed = 0;
  const auto pairs = pairPoses(run.tracked(), truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  ASSERT_TRUE(alignment);
  for (std::size_t i = 1; i < run.records.size(); ++i) {
    if (run.records[i].loops <= run.records[i - 1].loops) continue;
    ++closed;
    for (const PosePair& pair : pairs) {
      if (pair.stamp_s != run.records[i].pose.stamp_s) continue;
      if (absoluteTrajectoryError({pair}, *alignment) > 0.02) ++wrong;  // half of a field
    }
  }
  std::cout << "loops " << closed << ", wrong " << wrong << "\n";
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace test
}  // namespace active_matching_slam
