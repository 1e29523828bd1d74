// What the thesis leaves to others (chapter 8): submaps in use. Laps through a corridor of points
// that are known by number, with submaps cut by information and naively, with honest cuts and
// dropped links, and as filters do without submaps.

#include <algorithm>

#include "active_matching_slam/evaluation/corridor_laps.h"
#include "active_matching_slam/math/quantile.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

struct MapVariant {
  const char* name;
  CorridorOptions options;
};

MapVariant mapVariant(const char* name, double laps, MapBound bound, SubmapBorders borders,
                      bool conservative) {
  CorridorOptions options;
  options.laps = laps;
  options.bound = bound;
  options.borders = borders;
  options.freeze.conservative = conservative;
  return {name, options};
}

/// Of the submaps frozen in one lap.
double medianBits(const CorridorResult& run, const std::vector<double>& bits, int lap) {
  std::vector<double> chosen;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    if (run.frozen_in_lap[i] == lap) chosen.push_back(bits[i]);
  }
  return medianOf(chosen);
}

}  // namespace

ExperimentResult runSubmapFilter(Workbench& bench) {
  constexpr auto kInformation = SubmapBorders::kInformation;
  constexpr auto kNaive = SubmapBorders::kNaive;
  constexpr auto kSubmaps = MapBound::kSubmaps;
  std::vector<MapVariant> variants = {
      mapVariant("information_conservative", 4.05, kSubmaps, kInformation, true),
      mapVariant("information_dropped", 4.05, kSubmaps, kInformation, false),
      mapVariant("naive_conservative", 2.12, kSubmaps, kNaive, true),
      mapVariant("naive_dropped", 2.12, kSubmaps, kNaive, false),
      mapVariant("deleted", 2.12, MapBound::kDelete, kInformation, true),
      mapVariant("whole_map", 2.12, MapBound::kNone, kInformation, true)};
  int seeds = 10;
  if (bench.quick()) {
    seeds = 1;
    variants.resize(1);
    variants.front().options.laps = 0.5;
  }
  Table laps({"variant", "seed", "lap", "nees", "nees_median", "error_m", "points", "trunk",
              "submaps", "active_most", "lost_bits_median", "frame_ms"});
  Table runs(
      {"variant", "seed", "error_before_loop_m", "error_after_loop_m", "freeze_ms", "activate_ms"});
  for (const MapVariant& chosen : variants) {
    // The whole map in one filter takes minutes a run.
    const int count = chosen.options.bound == MapBound::kNone ? std::min(seeds, 2) : seeds;
    for (int seed = 0; seed < count; ++seed) {
      bench.say(text("submap filter, %s, seed %d", chosen.name, seed));
      const CorridorResult run = runCorridorLaps(chosen.options, static_cast<std::uint64_t>(seed));
      for (std::size_t lap = 0; lap < run.laps.size(); ++lap) {
        const LapSummary& summary = run.laps[lap];
        laps.add({chosen.name, seed, static_cast<int>(lap) + 1, summary.nees, summary.nees_median,
                  summary.error_m, summary.points, summary.trunk, summary.leaves,
                  summary.active_most, medianBits(run, run.lost_bits, static_cast<int>(lap)),
                  summary.frame_ms});
      }
      runs.add({chosen.name, seed, run.error_before_loop_m, run.error_after_loop_m, run.freeze_ms,
                run.activate_ms});
    }
  }
  // The same submaps with six separators of either kind.
  Table bits({"seed", "lap", "information_bits", "naive_bits"});
  for (int seed = 0; seed < std::min(seeds, 3); ++seed) {
    CorridorOptions options = variants.front().options;
    options.laps = std::min(options.laps, 2.12);
    options.compared_separators = 6;
    const CorridorResult run = runCorridorLaps(options, static_cast<std::uint64_t>(seed));
    for (std::size_t i = 0; i < run.compared.size(); ++i) {
      bits.add({seed, run.compared[i].lap + 1, run.compared[i].information_bits,
                run.compared[i].naive_bits});
    }
  }
  ExperimentResult result;
  result.tables.emplace_back("", laps);
  result.tables.emplace_back("runs", runs);
  result.tables.emplace_back("bits", bits);
  return result;
}

}  // namespace active_matching_slam
