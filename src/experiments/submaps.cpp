// Table 6.1, figures 6.13 and 6.14: the information that a map keeps when it is cut into submaps,
// along the Chow-Liu tree and in order of initialisation.

#include "active_matching_slam/evaluation/structure_report.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

struct ThesisCase {
  const char* scene;
  const char* sequence;  ///< here
  const char* thesis;    ///< submaps: naive, Chow-Liu
};
constexpr ThesisCase kCases[] = {
    {"various depths", "two_depths", "2: 50.8 v 84.5 %; 7: 21.4 v 35.7 %"},
    {"sideways", "wall", "4: 74.7 v 93.8 %; 10: 51.7 v 75.4 %"},
    {"forward", "corridor", "3: 74.5 v 85.5 %; 18: 33.0 v 43.7 %"},
};

}  // namespace

ExperimentResult runSubmaps(Workbench& bench) {
  Table table(
      {"sequence", "features", "level", "submaps", "preserved_naive", "preserved_chow_liu"});
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
    std::string here;
    bool above = true;
    int shown_level = 0;
    for (std::size_t h = 0; h < submaps->levels.size(); ++h) {
      const SubmapLevel& level = submaps->levels[h];
      table.add({one.sequence, static_cast<int>(submaps->ids.size()), static_cast<int>(h),
                 level.submaps, level.preserved_naive, level.preserved_chow_liu});
      if (h == 0 || level.submaps < 2) continue;
      here = text("%d: %.1f v %.1f %%", level.submaps, 100.0 * level.preserved_naive,
                  100.0 * level.preserved_chow_liu) +
             (here.empty() ? "" : "; ") + here;
      above = above && level.preserved_chow_liu >= level.preserved_naive;
      shown_level = static_cast<int>(h);
    }
    result.findings.push_back({text("%s: submaps: naive v Chow-Liu", one.scene), one.thesis, here,
                               verdict(above && !here.empty())});
    result.pictures.emplace_back(one.sequence,
                                 informationMatrixPicture(*graph, *submaps, shown_level));
  }
  result.tables.emplace_back("", table);
  return result;
}

}  // namespace active_matching_slam
