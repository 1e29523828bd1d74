// What submaps that are laid aside cost a frame, by their number: where their features are now and
// which should be seen (`views`, each frame that starts features), which submap may be searched or
// looked for (`choice`, every fourth), and what is published of them (`describe`). The map of a
// walk along a corridor, its submaps copied until there are as many features. Counters: features,
// and bytes of the map's file for each.

#include <benchmark/benchmark.h>

#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../src/tracker/submap_keeper.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"
#include "saved_map.h"

namespace active_matching_slam {
namespace {

SimulatorOptions walkOptions() {
  SimulatorOptions options;
  options.scene = "corridor_loop";
  options.motion = "loop";
  options.width = 320;
  options.height = 240;
  options.rate_hz = 15.0;
  options.duration_s = 14.0;
  return options;
}

TrackerOptions trackerOptions() {
  TrackerOptions options;
  options.submap_filter.enabled = true;
  options.map.features_per_frame = 30;
  options.map.maximum_features = 100;
  return options;
}

const MapFileContent& walkedMap() {
  static const MapFileContent content = [] {
    Simulator simulator(walkOptions());
    Tracker tracker(simulator.camera(), trackerOptions());
    while (const auto frame = simulator.next()) tracker.track(frame->image, frame->stamp_s);
    MapFileContent read = savedMap(tracker);
    if (read.submaps.empty()) throw std::runtime_error("nothing was laid aside");
    return read;
  }();
  return content;
}

/// The same map with copies of its submaps, which hang on the same separators.
MapFileContent mapWith(int features) {
  MapFileContent content = walkedMap();
  const std::vector<Leaf> leaves = content.submaps;
  std::map<FeatureId, MapFeature> frozen;
  for (const MapFeature& feature : content.frozen) frozen.emplace(feature.id, feature);
  for (std::size_t k = 0; static_cast<int>(content.frozen.size()) < features; ++k) {
    Leaf copy = leaves[k % leaves.size()];
    copy.id = content.next_submap++;
    for (FeatureId& id : copy.points.ids) {
      MapFeature feature = frozen.at(id);
      feature.id = id = content.next_id++;
      content.frozen.push_back(feature);
    }
    content.submaps.push_back(std::move(copy));
  }
  return content;
}

struct SubmapProblem {
  explicit SubmapProblem(int features) : content(mapWith(features)) {
    filter.restore(content.camera_state, content.features, content.covariance, content.next_id);
    keeper.restore(content);
  }
  std::map<FeatureId, Eigen::Vector3d> positions() const { return keeper.positions(filter); }
  std::vector<FrozenView> views() const {
    return keeper.visible(positions(), filter, camera, options.map, options.image.border_px);
  }

  const TrackerOptions options = trackerOptions();
  const CameraModel camera = Simulator(walkOptions()).camera();
  MapFileContent content;
  Ekf filter{FilterOptions()};
  SubmapKeeper keeper{options.submap_filter};
};

void report(const SubmapProblem& problem, benchmark::State* state) {
  const double count = static_cast<double>(problem.content.frozen.size());
  state->counters["features"] = count;
  state->counters["bytes_each"] = static_cast<double>(serializeMap(problem.content).size()) / count;
}

void views(benchmark::State& state) {
  const SubmapProblem problem(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(problem.views());
  report(problem, &state);
}

void choice(benchmark::State& state) {
  SubmapProblem problem(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(problem.keeper.submapInView(problem.views(), problem.filter));
    benchmark::DoNotOptimize(problem.keeper.loopCandidates(problem.positions(), problem.filter,
                                                           problem.camera, problem.options.map, 3));
  }
  report(problem, &state);
}

void describe(benchmark::State& state) {
  const SubmapProblem problem(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(problem.keeper.describe(problem.filter));
  report(problem, &state);
}

BENCHMARK(views)->Arg(375)->Arg(750)->Arg(1500)->Arg(3000)->Unit(benchmark::kMillisecond);
BENCHMARK(choice)->Arg(375)->Arg(750)->Arg(1500)->Arg(3000)->Unit(benchmark::kMillisecond);
BENCHMARK(describe)->Arg(375)->Arg(750)->Arg(1500)->Arg(3000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
