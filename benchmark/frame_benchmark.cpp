// Whole frames of the tracker, on one core: a hand-held camera in a rendered room.
//
// Cases `frame/<matcher>/<features>/<width>x<height>/<hz>`, with the defaults of live use apart
// from the number of features; `exhaustive` cases have the matcher's stop rule and budget of time
// off. Counters: median, 99th percentile and worst of a frame, medians of its stages, and of the
// matching alone median, 90th percentile and worst, with the pixels of the gates over those that it
// searched. At 10 Hz the gates of the default motion noise are wide; 1920 x 1080 is tracked
// reduced.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"
#include "thread_seconds.h"

namespace active_matching_slam {
namespace {

struct Sequence {
  CameraModel camera;
  std::vector<SimulatedFrame> frames;
};

const Sequence& renderedRoom(int width, int height, int rate) {
  static std::map<std::tuple<int, int, int>, Sequence> cache;
  const auto key = std::make_tuple(width, height, rate);
  if (const auto known = cache.find(key); known != cache.end()) return known->second;
  SimulatorOptions options;
  options.motion = "jerky";
  options.width = width;
  options.height = height;
  options.rate_hz = rate;
  options.duration_s = 9.0;
  Simulator simulator(options);
  Sequence sequence{simulator.camera(), {}};
  while (auto frame = simulator.next()) sequence.frames.push_back(std::move(*frame));
  return cache.emplace(key, std::move(sequence)).first->second;
}

/// Values of one quantity, a frame each.
class Series {
 public:
  void add(double value) { values_.push_back(value); }
  double quantile(double fraction) {
    std::sort(values_.begin(), values_.end());
    return values_.empty() ? 0.0
                           : values_[static_cast<std::size_t>(fraction * (values_.size() - 1))];
  }

 private:
  std::vector<double> values_;
};

struct Case {
  std::string matcher;
  int features, width, height, rate;
  bool exhaustive;
};

void trackFrames(benchmark::State& state, const Case& c) {
  const Sequence& sequence = renderedRoom(c.width, c.height, c.rate);
  TrackerOptions options;
  options.matcher = c.matcher;
  options.map.features_per_frame = c.features;
  options.map.maximum_features = std::max(options.map.maximum_features, c.features * 3 / 2);
  options.matching.modelled_time = false;  // as in the node
  if (c.exhaustive) {
    options.matching.latch_information_bits = 0.0;
    options.matching.max_milliseconds = 0.0;
  }
  Tracker tracker(sequence.camera, options);
  Series frame_ms, match_ms, matching_ms, measure_ms, update_ms, map_ms, matched;
  double pixels = 0.0, gates = 0.0, searches = 0.0;
  int lost = 0, most_gaussians = 0, cut_short = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const SimulatedFrame& image = sequence.frames[next++];
    const double start = threadSeconds();
    const auto frame = tracker.track(image.image, image.stamp_s);
    frame_ms.add(1e3 * (threadSeconds() - start));
    const MatchStatistics& s = frame->matching.statistics;
    lost += frame->state != TrackingState::kTracking;
    if (s.candidates == 0) continue;
    match_ms.add(frame->timings_ms.match);
    matching_ms.add(s.total_ms);
    measure_ms.add(frame->timings_ms.measure);
    update_ms.add(frame->timings_ms.update);
    map_ms.add(frame->timings_ms.map);
    matched.add(s.matched);
    pixels += static_cast<double>(s.pixels_searched);
    gates += static_cast<double>(s.pixels_full_gates);
    searches += s.searches;
    most_gaussians = std::max(most_gaussians, s.max_gaussians);
    cut_short += s.cut_short;
  }
  const double frames = static_cast<double>(next);
  state.counters["median_ms"] = frame_ms.quantile(0.5);
  state.counters["p99_ms"] = frame_ms.quantile(0.99);
  state.counters["worst_ms"] = frame_ms.quantile(1.0);
  state.counters["matching_median_ms"] = matching_ms.quantile(0.5);
  state.counters["matching_p90_ms"] = matching_ms.quantile(0.9);
  state.counters["matching_worst_ms"] = matching_ms.quantile(1.0);
  state.counters["stage_measure_ms"] = measure_ms.quantile(0.5);
  state.counters["stage_match_ms"] = match_ms.quantile(0.5);
  state.counters["stage_update_ms"] = update_ms.quantile(0.5);
  state.counters["stage_map_ms"] = map_ms.quantile(0.5);
  state.counters["matched"] = matched.quantile(0.5);
  state.counters["pixels"] = pixels / frames;
  state.counters["gates"] = gates / frames;
  state.counters["gates_over_pixels"] = gates / std::max(pixels, 1.0);
  state.counters["searches"] = searches / frames;
  state.counters["most_gaussians"] = most_gaussians;
  state.counters["cut_short"] = cut_short;
  state.counters["not_tracking"] = lost;
}

void registerFrames(const Case& c) {
  const std::string name = "frame/" + c.matcher + (c.exhaustive ? "+exhaustive" : "") + "/" +
                           std::to_string(c.features) + "/" + std::to_string(c.width) + "x" +
                           std::to_string(c.height) + "/" + std::to_string(c.rate);
  benchmark::RegisterBenchmark(name.c_str(),
                               [=](benchmark::State& state) { trackFrames(state, c); })
      ->Iterations(9 * c.rate)
      ->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  cv::setNumThreads(1);
  for (const char* matcher :
       {"auto", "active", "fast_active", "chow_liu", "jcbb", "one_point_ransac", "active_search"}) {
    active_matching_slam::registerFrames({matcher, 100, 640, 480, 30, false});
    active_matching_slam::registerFrames({matcher, 100, 1024, 768, 30, false});
  }
  for (const char* matcher : {"auto", "chow_liu", "jcbb", "one_point_ransac", "active_search"})
    active_matching_slam::registerFrames({matcher, 60, 640, 480, 10, false});
  active_matching_slam::registerFrames({"auto", 60, 640, 480, 30, false});
  active_matching_slam::registerFrames({"auto", 60, 1920, 1080, 30, false});
  for (const char* matcher : {"active", "fast_active", "chow_liu"})
    active_matching_slam::registerFrames({matcher, 100, 1024, 768, 30, true});
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
