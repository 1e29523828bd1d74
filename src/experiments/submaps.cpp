// Table 6.1, figures 6.13 and 6.14: the information that a map keeps when it is cut into submaps,
// along the Chow-Liu tree and in order of initialisation: by the levels of the hierarchy, and by
// the cuts that users get by number (submaps/count).

#include <algorithm>

#include "active_matching_slam/evaluation/structure_report.h"
#include "active_matching_slam/information/submap_cut.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

/// So many submaps preserve so much [%].
struct ThesisPartition {
  int submaps;
  double naive, chow_liu;
};
struct ThesisCase {
  const char* scene;
  const char* sequence;  ///< here
  ThesisPartition partitions[2];
};
constexpr ThesisCase kCases[] = {
    {"various depths", "two_depths", {{2, 50.8, 84.5}, {7, 21.4, 35.7}}},
    {"sideways", "wall", {{4, 74.7, 93.8}, {10, 51.7, 75.4}}},
    {"forward", "corridor", {{3, 74.5, 85.5}, {18, 33.0, 43.7}}},
};

std::string preservedText(const ThesisPartition& p) {
  return text("%d: %.1f v %.1f %%", p.submaps, p.naive, p.chow_liu);
}

/// Gain over the naive partition, of what that one loses.
double gainOf(const ThesisPartition& p) { return (p.chow_liu - p.naive) / (100.0 - p.naive); }

ThesisPartition cutHere(const MutualInformationGraph& graph, const SubmapHierarchy& submaps,
                        int count) {
  const SubmapLevel level = levelOf(cutIntoSubmaps(graph, submaps, count), graph);
  return {level.submaps, 100.0 * level.preserved_naive, 100.0 * level.preserved_chow_liu};
}

}  // namespace

ExperimentResult runSubmaps(Workbench& bench) {
  Table table(
      {"sequence", "features", "by", "number", "submaps", "preserved_naive", "preserved_chow_liu"});
  ExperimentResult result;
  for (const ThesisCase& one : kCases) {
    const Sequence& sequence = bench.sequence(one.sequence);
    bench.say(text("structure of the map of %s", one.sequence));
    TrackerOptions options = referenceOptions(sequence, bench.quick() ? 20 : 30);
    options.map.maximum_features = 300;  // the map is to grow, as the thesis's does
    options.structure = true;
    std::shared_ptr<const MutualInformationGraph> graph;
    std::shared_ptr<const SubmapHierarchy> submaps;
    trackSequence(sequence, options, 1, [&](const TrackedFrame& frame, int) {
      if (frame.graph) graph = frame.graph;
      if (frame.submaps) submaps = frame.submaps;
    });
    if (!graph || !submaps) continue;
    std::string levels;
    bool above = true;
    int shown_level = 0;
    const auto add = [&](const char* by, const SubmapLevel& level, int number) {
      table.add({one.sequence, static_cast<int>(submaps->ids.size()), by, number, level.submaps,
                 level.preserved_naive, level.preserved_chow_liu});
    };
    for (std::size_t h = 0; h < submaps->levels.size(); ++h) {
      const SubmapLevel& level = submaps->levels[h];
      add("level", level, static_cast<int>(h));
      if (h == 0 || level.submaps < 2) continue;
      levels = preservedText({level.submaps, 100.0 * level.preserved_naive,
                              100.0 * level.preserved_chow_liu}) +
               (levels.empty() ? "" : "; ") + levels;
      above = above && level.preserved_chow_liu >= level.preserved_naive;
      shown_level = static_cast<int>(h);
    }
    std::string thesis, cuts;
    double least_share = 1.0;
    for (const ThesisPartition& p : one.partitions) {
      const ThesisPartition cut = cutHere(*graph, *submaps, p.submaps);
      table.add({one.sequence, static_cast<int>(submaps->ids.size()), "count", p.submaps,
                 cut.submaps, cut.naive / 100.0, cut.chow_liu / 100.0});
      thesis += (thesis.empty() ? "" : "; ") + preservedText(p);
      cuts += (cuts.empty() ? "" : "; ") + preservedText(cut);
      least_share = std::min(least_share, gainOf(cut) / gainOf(p));
    }
    result.findings.push_back({text("%s: levels of the hierarchy: naive v Chow-Liu", one.scene),
                               thesis, levels, verdict(above && !levels.empty())});
    result.findings.push_back(
        {text("%s: as many submaps as there, by submaps/count; 0.8 of the gain over naive",
              one.scene),
         thesis, cuts, verdict(least_share >= 0.8)});
    result.pictures.emplace_back(one.sequence,
                                 informationMatrixPicture(*graph, *submaps, shown_level));
  }
  result.tables.emplace_back("", table);
  return result;
}

}  // namespace active_matching_slam
