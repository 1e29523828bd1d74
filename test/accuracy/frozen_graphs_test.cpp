// Makes the graphs of test/data/graphs/, on which test/information/frozen_structure_test.cpp runs.
// With AMS_DATA set, from the folder test/:
//
//   AMS_FREEZE_GRAPHS=data/graphs test_accuracy --gtest_filter='*FrozenGraphs*'
//
// No other test depends on what this build would write there.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/recorded_sequence.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"
#include "support/frozen_graph.h"
#include "support/recorded_data.h"

namespace active_matching_slam {
namespace {

std::string folderOfGraphs() {
  const char* folder = std::getenv("AMS_FREEZE_GRAPHS");
  return folder ? folder : "";
}

/// 'a', 'b', or '.' for neither.
using GroupOf = std::function<char(const TrackedFeature&)>;

/// The table, and the wall with the floor before it.
GroupOf byDepth(const TrackedFrame& frame) {
  constexpr double kBetween_m = 2.0;  // the table is at most 1 m off, wall and floor 4 m and more
  const Eigen::Isometry3d T_camera_world = frame.camera.poseWorldCamera().inverse();
  return [T_camera_world](const TrackedFeature& feature) {
    return (T_camera_world * feature.position_world).z() < kBetween_m ? 'a' : 'b';
  };
}

/// Left wall and right, not what is between: the world is that of the first camera, which stands
/// in the middle and looks along them.
GroupOf bySide(const TrackedFrame& frame) {
  std::vector<double> distances;
  for (const TrackedFeature& feature : frame.features)
    distances.push_back(std::abs(feature.position_world.x()));
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double wall = *middle;
  return [wall](const TrackedFeature& feature) {
    const double x = feature.position_world.x();
    return std::abs(x) < 0.5 * wall ? '.' : x < 0.0 ? 'a' : 'b';
  };
}

void freeze(const std::string& name, const std::string& comment, const TrackedFrame& frame,
            const GroupOf& group_of) {
  ASSERT_TRUE(frame.graph);
  std::map<FeatureId, char> groups;  // without those that left the map since the graph was made
  for (const TrackedFeature& feature : frame.features) groups[feature.id] = group_of(feature);
  std::vector<char> group_of_node;
  for (const std::int64_t id : frame.graph->ids) {
    const auto at = groups.find(id);
    group_of_node.push_back(at == groups.end() ? '.' : at->second);
  }
  test::writeFrozenGraph(folderOfGraphs() + "/" + name + ".txt", comment, *frame.graph,
                         group_of_node);
}

struct FilmOfGraph {
  std::string scene, motion;
  std::uint64_t seed = 1;
};

std::ostream& operator<<(std::ostream& out, const FilmOfGraph& film) {
  return out << film.scene << "_" << film.motion << "_" << film.seed;
}

class FrozenGraphsOfFilms : public testing::TestWithParam<FilmOfGraph> {};

/// The first two seconds tell the scale: from then on the map is metric, as the thesis's maps are,
/// so that depths and the noise of the motion are what they say.
TEST_P(FrozenGraphsOfFilms, AreWritten) {
  if (folderOfGraphs().empty()) GTEST_SKIP() << "skipped: AMS_FREEZE_GRAPHS is not set";
  constexpr int kFramesToScale = 60;
  SimulatorOptions simulation;
  simulation.scene = GetParam().scene;
  simulation.motion = GetParam().motion;
  simulation.seed = GetParam().seed;
  simulation.width = 320;
  simulation.height = 240;
  simulation.duration_s = simulation.scene == "corridor_end" ? 15.0 : 10.0;
  Simulator simulator(simulation);
  TrackerOptions options;
  options.structure = true;
  Tracker tracker(simulator.camera(), options);
  std::shared_ptr<const TrackedFrame> last;
  Eigen::Isometry3d T_world_start;
  while (const auto image = simulator.next()) {
    last = tracker.track(image->image, image->stamp_s);
    if (image->index == 0) T_world_start = image->truth.T_world_camera;
    if (image->index != kFramesToScale) continue;
    const Eigen::Isometry3d T_start_camera = T_world_start.inverse() * image->truth.T_world_camera;
    tracker.setScale(T_start_camera.translation().norm() / last->camera.position_world.norm());
  }
  const std::string name = testing::PrintToString(GetParam());
  if (simulation.scene == "two_depths") {
    freeze(name, name + ": a on the table, b on the wall behind", *last, byDepth(*last));
  } else if (simulation.scene == "corridor_end") {
    freeze(name, name + ": a on the left wall, b on the right", *last, bySide(*last));
  } else {
    freeze(name, name, *last, [](const TrackedFeature&) { return '.'; });
  }
}

std::vector<FilmOfGraph> films() {
  std::vector<FilmOfGraph> films = {{"two_depths", "circle", 1},
                                    {"two_depths", "slow", 1},
                                    {"two_depths", "slow", 2},
                                    {"two_depths", "sideways", 1},
                                    {"room", "slow", 1}};
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    films.push_back({"wall", "sideways", seed});
    films.push_back({"corridor", "forward", seed});
    if (seed <= 3) films.push_back({"corridor_end", "sweep", seed});
  }
  return films;
}

INSTANTIATE_TEST_SUITE_P(Films, FrozenGraphsOfFilms, testing::ValuesIn(films()));

class FrozenGraphsOfRecordings : public testing::TestWithParam<const char*> {};

/// With about as many features in a frame as the thesis's maps have.
TEST_P(FrozenGraphsOfRecordings, AreWritten) {
  if (folderOfGraphs().empty()) GTEST_SKIP() << "skipped: AMS_FREEZE_GRAPHS is not set";
  if (recordedDataFolder().empty()) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  RecordedSequence sequence(recordedDataFolder() + "/" + GetParam());
  TrackerOptions options;
  options.structure = true;
  options.map.features_per_frame = 15;
  Tracker tracker(sequence.camera(), options);
  std::shared_ptr<const TrackedFrame> last;
  sequence.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    const auto frame = tracker.track(image, stamp_s);
    if (frame->graph) last = frame;
    return true;
  });
  ASSERT_TRUE(last);
  freeze(GetParam(), std::string(GetParam()) + ", 15 features in a frame", *last,
         [](const TrackedFeature&) { return '.'; });
}

INSTANTIATE_TEST_SUITE_P(Recordings, FrozenGraphsOfRecordings,
                         testing::Values("davison_monoslam_desk", "uzh_vamr_checkerboard",
                                         "sevenscenes_redkitchen", "oekf_desk_translation"));

}  // namespace
}  // namespace active_matching_slam
