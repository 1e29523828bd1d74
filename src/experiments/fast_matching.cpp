// Figures 7.2 and 7.3: Fast Active Matching against JCBB.

#include "test_bed_charts.h"

namespace active_matching_slam {

ExperimentResult runFastMatching(Workbench& bench) {
  const int many = 60;  // as in figure 7.3
  const std::vector<std::string> matchers = {"fast_active", "jcbb", "active"};
  ExperimentResult result;
  std::vector<TestBedCell> cells;
  for (const TestBedCell& cell : bench.testBed())
    if (cell.matcher == "fast_active" || cell.matcher == "jcbb" || cell.matcher == "active")
      cells.push_back(cell);
  result.tables.emplace_back("", tableOf(cells));
  result.pictures.emplace_back(
      "", tilePictures(
              {chartByRate(bench, text("Pixels searched, %d features (7.2a)", many), "pixels", many,
                           matchers, pixelsOf, true),
               chartByRate(bench, text("Spurious matches met, %d features (7.2b)", many), "matches",
                           many, matchers, spuriousOf),
               timesByFeatures(bench, "fast_active", 30.0), timesByFeatures(bench, "jcbb", 30.0),
               timesByRate(bench, "fast_active", many), timesByRate(bench, "jcbb", many)},
              3));
  const auto pixels = ratiosByRate(bench, many, "jcbb", "fast_active", pixelsOf);
  result.findings.push_back({text("pixels JCBB : FAM, %d features", many),
                             "significantly fewer at low rates", byRateText(bench, pixels, "%.1f"),
                             verdict(!pixels.empty() && pixels.back() > 2.0)});
  const auto spurious = ratiosByRate(bench, many, "fast_active", "jcbb", spuriousOf);
  result.findings.push_back({text("spurious matches FAM : JCBB, %d features", many), "far fewer",
                             byRateText(bench, spurious, "%.2f"),
                             verdict(!spurious.empty() && spurious.back() < 0.5)});
  const auto to_active = ratiosByRate(bench, many, "fast_active", "active", pixelsOf);
  result.findings.push_back({text("pixels FAM : AM, %d features", many), "more than AM",
                             byRateText(bench, to_active, "%.2f"),
                             verdict(!to_active.empty() && to_active.back() >= 1.0)});
  const auto time = ratiosByRate(bench, many, "fast_active", "active", totalOf);
  result.findings.push_back(
      {text("time FAM : AM, %d features", many), "far less than AM (0.004 in table 7.1)",
       byRateText(bench, time, "%.2f"), verdict(!time.empty() && time[0] < 0.5), true});
  return result;
}

}  // namespace active_matching_slam
