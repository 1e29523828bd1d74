// Figures 5.10 to 5.13: AM and JCBB by the number of features and by the frame rate.

#include <cmath>

#include "test_bed_charts.h"

namespace active_matching_slam {

ExperimentResult runFeaturesAndRate(Workbench& bench) {
  const std::vector<int> counts = bench.featureCounts();
  const int few = counts[1], most = counts.back();
  const double slow_hz = 7.5, fast_hz = 30.0;
  const std::vector<std::string> matchers = {"active", "jcbb"};
  ExperimentResult result;
  result.tables.emplace_back("", tableOf(bench.testBed()));
  const auto gaussians = [](const TrialSummary& s) { return s.mean_most_gaussians; };
  result.pictures.emplace_back(
      "", tilePictures(
              {chartByFeatures(bench, text("Pixels searched, %.4g Hz (5.10a)", slow_hz), "pixels",
                               slow_hz, matchers, pixelsOf),
               chartByFeatures(bench, text("Spurious matches met, %.4g Hz (5.10b)", slow_hz),
                               "matches", slow_hz, matchers, spuriousOf),
               timesByFeatures(bench, "active", slow_hz), timesByFeatures(bench, "jcbb", slow_hz),
               timesByFeatures(bench, "active", fast_hz), timesByFeatures(bench, "jcbb", fast_hz),
               chartByRate(bench, text("Pixels searched, %d features (5.12a)", few), "pixels", few,
                           matchers, pixelsOf, true),
               chartByRate(bench, text("Spurious matches met, %d features (5.12b)", few), "matches",
                           few, matchers, spuriousOf),
               chartByRate(bench, text("Most Gaussians, mean, %d features (5.12c)", few),
                           "Gaussians", few, {"active"}, gaussians),
               timesByRate(bench, "active", few), timesByRate(bench, "jcbb", few),
               timesByRate(bench, "active", bench.quick() ? most : 40),
               timesByRate(bench, "jcbb", bench.quick() ? most : 40)},
              3));

  // Every cell of every sequence: does AM search less than JCBB?
  int cells = 0, fewer = 0, fewer_spurious = 0;
  for (const TestBedCell& cell : bench.testBed()) {
    if (cell.matcher != "active" || cell.summary.frames == 0) continue;
    const auto* jcbb = bench.cell(cell.sequence, cell.rate_hz, cell.features, "jcbb");
    ++cells;
    fewer += cell.summary.pixels < jcbb->summary.pixels;
    fewer_spurious += cell.summary.spurious <= jcbb->summary.spurious;
  }
  result.findings.push_back({"cells of the test-bed in which AM searches fewer pixels than JCBB",
                             "all", text("%d of %d", fewer, cells), verdict(fewer == cells)});
  result.findings.push_back({"... and meets no more spurious matches", "all",
                             text("%d of %d", fewer_spurious, cells),
                             verdict(fewer_spurious == cells)});
  std::vector<double> gaps;
  for (const int every : bench.everies()) {
    const auto* jcbb = bench.cell(bench.mainSequence(), 30.0 / every, few, "jcbb");
    const auto* active = bench.cell(bench.mainSequence(), 30.0 / every, few, "active");
    if (jcbb && active) gaps.push_back(jcbb->summary.pixels - active->summary.pixels);
  }
  const auto ratios = ratiosByRate(bench, few, "jcbb", "active", pixelsOf);
  result.findings.push_back({text("pixels JCBB : AM, %d features", few),
                             "6.9 to 8.3 with 11 features at 30 and 15 Hz",
                             byRateText(bench, ratios, "%.1f")});
  result.findings.push_back({text("pixels that AM saves, %d features", few),
                             "the gap widens as the rate falls", byRateText(bench, gaps, "%.0f"),
                             verdict(isRising(gaps))});
  std::vector<double> most_gaussians;
  for (const int every : bench.everies())
    if (const auto* cell = bench.cell(bench.mainSequence(), 30.0 / every, few, "active"))
      most_gaussians.push_back(cell->summary.mean_most_gaussians);
  result.findings.push_back({text("Gaussians at most, mean of the frames, %d features", few),
                             "more as the rate falls", byRateText(bench, most_gaussians, "%.1f"),
                             verdict(isRising(most_gaussians))});
  const auto* small = bench.cell(bench.mainSequence(), fast_hz, few, "active");
  const auto* large = bench.cell(bench.mainSequence(), fast_hz, most, "active");
  if (small && large) {
    const TrialSummary& s = large->summary;
    const double fraction = s.information_ms / s.total_ms;
    result.findings.push_back({text("fraction of MI in AM's time, %d features", most),
                               "the dominating step", text("%.0f %%", 100.0 * fraction),
                               verdict(fraction > 0.5), true});
    result.findings.push_back(
        {text("AM's time from %d to %d features grows with the power", few, most),
         "scales badly: O(K F^4) to O(K F^5)",
         text("%.1f",
              std::log(s.total_ms / small->summary.total_ms) / std::log(double(most) / few)),
         Finding::Verdict::kNoVerdict, true});
  }
  return result;
}

}  // namespace active_matching_slam
