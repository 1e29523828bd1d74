// What the structure of the map costs of a frame (graph of mutual information, tree, submaps), in a
// simulated room: frame_percent of the frame's time, with about 'visible' features in view of which
// 'chosen' at most are measured. Timed is the structure alone.

#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

const std::vector<SimulatedFrame>& film() {
  static const std::vector<SimulatedFrame> frames = [] {
    SimulatorOptions options;
    options.duration_s = 4.0;
    Simulator simulator(options);
    std::vector<SimulatedFrame> rendered;
    while (auto frame = simulator.next()) rendered.push_back(*frame);
    return rendered;
  }();
  return frames;
}

void BM_StructureOfAFrame(benchmark::State& state) {
  constexpr std::size_t kFramesToFillTheMap = 40;
  const int visible = static_cast<int>(state.range(0)), chosen = static_cast<int>(state.range(1));
  const SimulatorOptions simulated;
  TrackerOptions options;
  options.structure = true;
  options.map.features_per_frame = visible;
  options.map.maximum_features = 2 * visible;
  options.map.minimum_distance_px = 12.0;
  double structure_ms = 0.0, total_ms = 0.0, mapped = 0.0, measured = 0.0, frames = 0.0;
  std::size_t next = film().size();
  std::unique_ptr<Tracker> tracker;
  for (auto _ : state) {
    if (next == film().size()) {
      options.map.features_per_frame = visible;
      tracker =
          std::make_unique<Tracker>(CameraModel(makeSimulatedCalibration(
                                        simulated.width, simulated.height, simulated.distortion)),
                                    options);
      for (next = 0; next < kFramesToFillTheMap; ++next)
        tracker->track(film()[next].image, film()[next].stamp_s);
      options.map.features_per_frame = chosen;
      tracker->setOptions(options);
    }
    const auto frame = tracker->track(film()[next].image, film()[next].stamp_s);
    ++next;
    state.SetIterationTime(1e-3 * frame->timings_ms.structure);
    structure_ms += frame->timings_ms.structure;
    total_ms += frame->timings_ms.total;
    measured += static_cast<double>(frame->prior.size());
    mapped += static_cast<double>(frame->features.size());
    ++frames;
  }
  state.counters["frame_percent"] = 100.0 * structure_ms / total_ms;
  state.counters["frame_ms"] = total_ms / frames;
  state.counters["in_map"] = mapped / frames;
  state.counters["measured"] = measured / frames;
}
BENCHMARK(BM_StructureOfAFrame)
    ->ArgNames({"visible", "chosen"})
    ->Args({60, 60})
    ->Args({100, 100})
    ->Args({100, 60})
    ->UseManualTime()
    ->Iterations(160)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
