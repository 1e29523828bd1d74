// Table 5.2: what one tracking step costs with 11 features, by JCBB and by AM.

#include "workbench.h"

namespace active_matching_slam {
namespace {

struct ThesisRow {
  const char* motion;
  const char* sequence;  ///< here
  double rate_hz;
  const char* pixels;
  double ratio;
  int most_gaussians;
};
constexpr ThesisRow kThesis[] = {
    {"fast", "office_fast", 30.0, "40341 : 5039 = 8.01", 8.01, 7},
    {"fast", "office_fast", 15.0, "78675 : 9508 = 8.27", 8.27, 10},
    {"slow", "office_slow", 30.0, "21517 : 3124 = 6.89", 6.89, 5},
    {"slow", "office_slow", 15.0, "40548 : 5212 = 7.78", 7.78, 6},
};

}  // namespace

ExperimentResult runTrackingStep(Workbench& bench) {
  const int features = bench.featureCounts().front();
  Table table({"sequence", "rate_hz", "matcher", "frames", "step_ms", "matching_ms", "pixels",
               "pixels_ratio", "most_gaussians", "frames_same_as_jcbb", "wrong", "missed"});
  ExperimentResult result;
  std::vector<cv::Mat> pictures;
  int same = 0, frames = 0, jcbb_wrong_or_missed = 0, active_wrong_or_missed = 0;
  BarChart chart{"Pixels searched a frame, 11 features",
                 "sequence, rate [Hz], matcher",
                 "pixels",
                 {"pixels"},
                 {}};
  for (const std::string& name : bench.testBedSequences())
    for (const int every : bench.everies()) {
      const double rate_hz = 30.0 / every;
      const TestBedCell* jcbb = bench.cell(name, rate_hz, features, "jcbb");
      const TestBedCell* active = bench.cell(name, rate_hz, features, "active");
      if (!jcbb || !active) continue;
      for (const TestBedCell* cell : {jcbb, active}) {
        const TrialSummary& s = cell->summary;
        table.add({name, rate_hz, cell->matcher, s.frames, s.other_ms + s.total_ms, s.total_ms,
                   s.pixels, jcbb->summary.pixels / s.pixels, s.most_gaussians, s.same_as_jcbb,
                   s.wrong, s.missed});
        if (every <= 2 || bench.quick())
          chart.bars.push_back(
              {name.substr(0, 4) +
                   name.substr(name.find('_') == std::string::npos ? 4 : name.find('_'), 3) +
                   text(" %.3g %c", rate_hz, cell->matcher[0]),
               {s.pixels}});
      }
      same += active->summary.same_as_jcbb;
      frames += active->summary.frames;
      const auto faults = [](const TrialSummary& s) {
        return static_cast<int>((s.wrong + s.missed) * s.frames + 0.5);
      };
      jcbb_wrong_or_missed += faults(jcbb->summary);
      active_wrong_or_missed += faults(active->summary);
    }
  for (const ThesisRow& row : kThesis) {
    const TestBedCell* jcbb = bench.cell(row.sequence, row.rate_hz, features, "jcbb");
    const TestBedCell* active = bench.cell(row.sequence, row.rate_hz, features, "active");
    if (!jcbb || !active) continue;
    const double ratio = jcbb->summary.pixels / active->summary.pixels;
    result.findings.push_back(
        {text("pixels, JCBB : AM, %s %.0f Hz", row.motion, row.rate_hz), row.pixels,
         text("%.0f : %.0f = %.2f", jcbb->summary.pixels, active->summary.pixels, ratio),
         judge(ratio > 0.5 * row.ratio)});
    result.findings.push_back({text("most Gaussians, AM, %s %.0f Hz", row.motion, row.rate_hz),
                               std::to_string(row.most_gaussians),
                               std::to_string(active->summary.most_gaussians)});
    result.findings.push_back(
        {text("matching alone, JCBB / AM, %s %.0f Hz", row.motion, row.rate_hz),
         "52.4 / 15.6 to 97.1 / 30.4 ms",
         text("%.2f / %.2f ms", jcbb->summary.total_ms, active->summary.total_ms),
         judge(active->summary.total_ms < jcbb->summary.total_ms), true});
  }
  result.findings.push_back({"frames with the same associations by both", "all",
                             text("%d of %d", same, frames), judge(same == frames)});
  result.findings.push_back({"features wrong or missed, JCBB and AM", "-",
                             text("%d and %d", jcbb_wrong_or_missed, active_wrong_or_missed)});
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", drawBarChart(chart, 1200, 480));
  return result;
}

}  // namespace active_matching_slam
