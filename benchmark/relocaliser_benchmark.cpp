// Cost of a relocalisation attempt in the whole map: where the place is found, and where it is not.
// Maps of about 60 and 150 features, 320 x 240 and 640 x 480 pixels. Cases `steps/...`: the parts
// into which a look is cut; their modelled time, by which the tracker spreads them over frames,
// over the measured, and the longest.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <functional>

#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"
#include "saved_map.h"
#include "thread_seconds.h"

namespace active_matching_slam {
namespace {

SimulatorOptions filmOptions(const std::string& scene, int width) {
  SimulatorOptions options;
  options.scene = scene;
  options.width = width;
  options.height = width * 3 / 4;
  options.duration_s = 4.0;
  return options;
}

/// A map as the tracker makes it.
MapFileContent trackedMap(Simulator* simulator, int features) {
  TrackerOptions options;
  options.map.features_per_frame = features;
  Tracker tracker(simulator->camera(), options);
  for (int i = 0; i < 100; ++i) {
    const auto frame = simulator->next();
    tracker.track(frame->image, frame->stamp_s);
  }
  return savedMap(tracker);
}

/// A map of a room, and an image that was taken in it, or elsewhere.
struct LookProblem {
  LookProblem(const benchmark::State& state, const std::string& scene)
      : room(filmOptions("room", static_cast<int>(state.range(0)))),
        content(trackedMap(&room, static_cast<int>(state.range(1)))) {
    filter.restore(content.camera_state, content.features, content.covariance, content.next_id);
    for (const MapFeature& feature : content.map) map.add(feature);
    Simulator other(filmOptions(scene, static_cast<int>(state.range(0))));
    image = scene == "room" ? room.next()->image : other.next()->image;
  }

  Simulator room;
  MapFileContent content;
  Ekf filter{FilterOptions()};
  FeatureMap map;
  const Relocaliser relocaliser{{}, {}, {}};
  cv::Mat image;
};

void look(benchmark::State& state, const std::string& scene) {
  const LookProblem problem(state, scene);
  bool found = false;
  for (auto _ : state)
    found =
        problem.relocaliser.find(problem.room.camera(), problem.image, problem.filter, problem.map)
            .has_value();
  state.counters["features"] = problem.map.size();
  state.counters["found"] = found;
}

void steps(benchmark::State& state, const std::string& scene) {
  const LookProblem problem(state, scene);
  const Relocaliser& relocaliser = problem.relocaliser;
  const CameraModel& camera = problem.room.camera();
  const std::vector<Landmark> landmarks = relocaliser.usableLandmarks(problem.filter, problem.map);
  double modelled_ms = 0.0, measured_ms = 0.0, longest_ms = 0.0;
  const auto measure = [&](double modelled, const std::function<void()>& work) {
    const double start = threadSeconds();
    work();
    const double spent_ms = 1e3 * (threadSeconds() - start);
    modelled_ms += modelled;
    measured_ms += spent_ms;
    longest_ms = std::max(longest_ms, spent_ms);
  };
  int count = 0;
  for (auto _ : state) {
    CameraLook look(problem.image, {});
    for (count = 0; !look.isOver(); ++count)
      measure(Relocaliser::stepMs(landmarks, look),
              [&] { relocaliser.step(camera, landmarks, &look); });
    if (!look.pose()) continue;
    measure(Relocaliser::proofMs(landmarks), [&] {
      benchmark::DoNotOptimize(
          relocaliser.prove(camera, problem.image, landmarks, *look.pose(), {}));
    });
  }
  state.counters["steps"] = count;
  state.counters["longest_ms"] = longest_ms;
  state.counters["modelled"] = modelled_ms / measured_ms;
}

BENCHMARK_CAPTURE(look, found, "room")
    ->Args({320, 40})
    ->Args({640, 40})
    ->Args({320, 100})
    ->Args({640, 100})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(look, elsewhere, "office")
    ->Args({320, 40})
    ->Args({640, 40})
    ->Args({320, 100})
    ->Args({640, 100})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(steps, found, "room")
    ->Args({320, 100})
    ->Args({640, 100})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(steps, elsewhere, "office")
    ->Args({320, 100})
    ->Args({640, 100})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
