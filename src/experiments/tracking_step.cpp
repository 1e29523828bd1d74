// Table 5.2: what one tracking step costs with 11 features, by JCBB and by AM.

#include <algorithm>

#include "workbench.h"

namespace active_matching_slam {
namespace {

struct ThesisRow {
  const char* motion;
  const char* recorded;  ///< the sequence here, where there are recordings
  const char* simulated;
  double rate_hz;
  const char* pixels;
  double ratio;
  int most_gaussians;
};
constexpr ThesisRow kThesis[] = {
    {"fast", "checkerboard", "office_fast", 30.0, "40341 : 5039 = 8.01", 8.01, 7},
    {"fast", "checkerboard", "office_fast", 15.0, "78675 : 9508 = 8.27", 8.27, 10},
    {"slow", "desk", "office_slow", 30.0, "21517 : 3124 = 6.89", 6.89, 5},
    {"slow", "desk", "office_slow", 15.0, "40548 : 5212 = 7.78", 7.78, 6},
};
/// The thesis's ellipses hold 21517 / 11 to 78675 / 11 pixels; a little more room on both sides.
constexpr double kSmallestGatePx = 1500.0, kLargestGatePx = 9500.0;
constexpr double kThesisLeastRatio = 6.89;

/// JCBB and AM on the same frames.
struct Pair {
  std::string sequence;
  double rate_hz;
  const TrialSummary* jcbb;
  const TrialSummary* active;

  double ratio() const { return jcbb->pixels / active->pixels; }
  double gatePx() const { return jcbb->gate_pixels / jcbb->candidates; }
};

std::vector<Pair> pairsOf(Workbench& bench, int features) {
  std::vector<Pair> pairs;
  for (const std::string& name : bench.testBedSequences())
    for (const int every : bench.everies()) {
      const double rate_hz = 30.0 / every;
      const TestBedCell* jcbb = bench.cell(name, rate_hz, features, "jcbb");
      const TestBedCell* active = bench.cell(name, rate_hz, features, "active");
      if (jcbb && active) pairs.push_back({name, rate_hz, &jcbb->summary, &active->summary});
    }
  return pairs;
}

const Pair* find(const std::vector<Pair>& pairs, const ThesisRow& row) {
  for (const char* name : {row.recorded, row.simulated})
    for (const Pair& pair : pairs)
      if (pair.sequence == name && pair.rate_hz == row.rate_hz) return &pair;
  return nullptr;
}

Table tableOf(const std::vector<Pair>& pairs) {
  Table table({"sequence", "rate_hz", "matcher", "frames", "step_ms", "matching_ms", "pixels",
               "pixels_jcbb_over_this", "gate_px", "most_gaussians", "frames_same_as_jcbb", "wrong",
               "missed"});
  for (const Pair& pair : pairs)
    for (const TrialSummary* s : {pair.jcbb, pair.active})
      table.add({pair.sequence, pair.rate_hz, s == pair.jcbb ? "jcbb" : "active", s->frames,
                 s->other_ms + s->total_ms, s->total_ms, s->pixels, pair.jcbb->pixels / s->pixels,
                 pair.gatePx(), s->most_gaussians, s->same_as_jcbb, s->wrong, s->missed});
  return table;
}

cv::Mat drawByGate(const std::vector<Pair>& pairs) {
  LineChart chart{"Pixels JCBB : AM by the size of the search ellipses, 11 features",
                  "pixels in the ellipse of a feature", "ratio", true, true};
  for (const Pair& pair : pairs) {
    if (chart.series.empty() || chart.series.back().name != pair.sequence)
      chart.series.push_back({pair.sequence, {}});
    chart.series.back().points.emplace_back(pair.gatePx(), pair.ratio());
  }
  return drawLineChart(chart, 960, 600);
}

}  // namespace

ExperimentResult runTrackingStep(Workbench& bench) {
  const std::vector<Pair> pairs = pairsOf(bench, bench.featureCounts().front());
  ExperimentResult result;
  result.tables.emplace_back("", tableOf(pairs));
  result.pictures.emplace_back("", drawByGate(pairs));
  for (const ThesisRow& row : kThesis) {
    const Pair* pair = find(pairs, row);
    if (!pair) continue;
    const std::string where =
        text("%s %.0f Hz (%s)", row.motion, row.rate_hz, pair->sequence.c_str());
    result.findings.push_back(
        {"pixels, JCBB : AM, " + where, row.pixels,
         text("%.0f : %.0f = %.2f", pair->jcbb->pixels, pair->active->pixels, pair->ratio()),
         verdict(pair->ratio() > 0.5 * row.ratio)});
    result.findings.push_back({"most Gaussians, AM, " + where, std::to_string(row.most_gaussians),
                               std::to_string(pair->active->most_gaussians)});
    result.findings.push_back({"matching alone, JCBB / AM, " + where,
                               "52.4 / 15.6 to 97.1 / 30.4 ms",
                               text("%.2f / %.2f ms", pair->jcbb->total_ms, pair->active->total_ms),
                               verdict(pair->active->total_ms < pair->jcbb->total_ms), true});
  }
  double least = 1e300, largest = 0.0;
  int large_gates = 0, same = 0, frames = 0, jcbb_faults = 0, active_faults = 0;
  const auto faults = [](const TrialSummary& s) {
    return static_cast<int>((s.wrong + s.missed) * s.frames + 0.5);
  };
  for (const Pair& pair : pairs) {
    same += pair.active->same_as_jcbb;
    frames += pair.active->frames;
    jcbb_faults += faults(*pair.jcbb);
    active_faults += faults(*pair.active);
    if (pair.gatePx() < kSmallestGatePx || pair.gatePx() > kLargestGatePx) continue;
    ++large_gates;
    least = std::min(least, pair.ratio());
    largest = std::max(largest, pair.ratio());
  }
  if (large_gates > 0)
    result.findings.push_back(
        {"pixels, JCBB : AM, where the ellipses are as large as the thesis's (1500 to 9500 px)",
         "6.89 to 8.27", text("%.1f to %.1f (%d sequences and rates)", least, largest, large_gates),
         verdict(least > 0.5 * kThesisLeastRatio)});
  result.findings.push_back({"frames with the same associations by both", "all",
                             text("%d of %d", same, frames), verdict(same == frames)});
  result.findings.push_back({"features wrong or missed, JCBB and AM", "-",
                             text("%d and %d", jcbb_faults, active_faults)});
  return result;
}

}  // namespace active_matching_slam
