// Cost of a relocalisation attempt in the whole map: where the place is found, and where it is not.
// Maps of about 60 and 150 features, 320 x 240 and 640 x 480 pixels.

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdio>
#include <stdexcept>

#include "active_matching_slam/map/map_file.h"
#include "active_matching_slam/map/relocaliser.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

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
  char path[] = "/tmp/relocaliser_benchmark_XXXXXX";
  const int file = ::mkstemp(path);
  if (file < 0) throw std::runtime_error("can't make a temporary file");
  ::close(file);
  tracker.saveMap(path);
  MapFileContent content = readMapFile(path);
  std::remove(path);
  return content;
}

void look(benchmark::State& state, const std::string& scene) {
  const int width = static_cast<int>(state.range(0));
  Simulator room(filmOptions("room", width)), other(filmOptions(scene, width));
  const MapFileContent content = trackedMap(&room, static_cast<int>(state.range(1)));
  Ekf filter{FilterOptions()};
  filter.restore(content.camera_state, content.features, content.covariance, content.next_id);
  FeatureMap map;
  for (const MapFeature& feature : content.map) map.add(feature);
  const Relocaliser relocaliser({}, {}, {});
  const cv::Mat image = scene == "room" ? room.next()->image : other.next()->image;
  bool found = false;
  for (auto _ : state) found = relocaliser.find(room.camera(), image, filter, map).has_value();
  state.counters["features"] = map.size();
  state.counters["found"] = found;
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

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
