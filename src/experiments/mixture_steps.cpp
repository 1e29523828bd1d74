// Figures 5.4 and 5.6: Active Matching of one frame step by step, and what becomes of the weights
// of its Gaussians.

#include <algorithm>
#include <set>

#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

/// A Gaussian of less weight has no say. Standard: the thesis's pruning threshold (section 5.3.2).
constexpr double kInsignificant = 0.001;
/// Gaussians that are kept without pruning, lest they double with each feature. Cost: milliseconds.
constexpr int kUnprunedGaussians = 40;

MatcherVariant unpruned() {
  MatcherVariant variant = matcherVariant("active");
  variant.options.prune_weight = 0.0;
  variant.options.max_gaussians = kUnprunedGaussians;
  variant.options.finish_weight = 0.5;
  return variant;
}

cv::Scalar colorOf(int gaussian) {
  static const cv::Scalar colors[] = {{90, 90, 240},  {240, 170, 60}, {80, 220, 80},
                                      {60, 220, 240}, {230, 90, 230}, {240, 240, 90}};
  return colors[static_cast<std::size_t>(gaussian) % (sizeof(colors) / sizeof(colors[0]))];
}

/// A frame is ambiguous where a search has met two matches or more.
bool isAmbiguous(const MatchingTrial& trial) {
  return std::any_of(trial.result.trace.begin(), trial.result.trace.end(),
                     [](const MatchStep& step) { return step.spawned.size() > 1; });
}

JointPoints stateOf(const MeasurementPrior& prior, const MatchReplay& replay, int gaussian) {
  JointPoints joint{prior.z, prior.S};
  for (const MatchReplay::Match& match : replay.matchesOf(gaussian))
    joint.condition(match.feature, match.pixel);
  return joint;
}

/// All live Gaussians, and the search that comes next; none after the last.
cv::Mat drawStep(const cv::Mat& image, const MeasurementPrior& prior, const MatchReplay& replay,
                 const std::vector<MatchStep>& trace, std::size_t step) {
  DebugCanvas canvas(image);
  std::vector<MatchStep::GaussianWeight> live = {{replay.prior(), -1, 1.0}};
  if (step > 0) live = trace[step - 1].pruned;
  std::string caption = text("after %zu searches:", step);
  for (const MatchStep::GaussianWeight& one : live) {
    drawJoint(stateOf(prior, replay, one.gaussian), colorOf(one.gaussian - replay.prior()),
              &canvas);
    caption += text(" G%d %.3f", one.gaussian - replay.prior(), one.weight);
  }
  if (step < trace.size()) {
    const SearchEllipse& next = trace[step].ellipse;
    for (const double wider : {1.0, 1.06, 1.12})
      canvas.ellipse(next.center, wider * next.covariance, {255, 255, 255});
  }
  return captioned(canvas.image(), canvas.unit(), caption.substr(0, 90));
}

cv::Mat drawSearched(const cv::Mat& image, const MeasurementPrior& prior,
                     const std::vector<MatchStep>& trace, double pixels, double gate_pixels) {
  DebugCanvas canvas(image);
  drawJoint({prior.z, prior.S}, {90, 90, 240}, &canvas);
  for (const MatchStep& step : trace)
    canvas.ellipse(step.ellipse.center, step.ellipse.covariance, {240, 240, 90});
  return captioned(canvas.image(), canvas.unit(),
                   text("searched %.0f px, whole gates %.0f px", pixels, gate_pixels));
}

cv::Mat drawWeights(const std::vector<MatchStep>& trace) {
  constexpr int kParts = 8;
  BarChart chart{"Weights by step, nothing pruned (5.6)", "matching step", "weight", {}, {}};
  for (int g = 0; g + 1 < kParts; ++g) chart.parts.push_back(text("G%d", g));
  chart.parts.push_back("later ones");
  const int first = trace.front().gaussian;
  for (std::size_t k = 0; k < std::min<std::size_t>(24, trace.size()); ++k) {
    ChartBar bar{std::to_string(k + 1), std::vector<double>(kParts, 0.0)};
    for (const MatchStep::GaussianWeight& one : trace[k].weights)
      bar.values[static_cast<std::size_t>(std::min(one.gaussian - first, kParts - 1))] +=
          one.weight;
    chart.bars.push_back(bar);
  }
  return drawBarChart(chart);
}

struct Tally {
  int frames = 0, less_area = 0, same = 0;
  double weight = 0.0, pixels = 0.0, gates = 0.0;
  double live = 0.0, live_unpruned = 0.0, insignificant = 0.0;
};

}  // namespace

ExperimentResult runMixtureSteps(Workbench& bench) {
  Table table({"sequence", "image", "step", "feature", "gaussian", "area_px", "matches", "live",
               "live_unpruned", "insignificant_unpruned", "heaviest"});
  ExperimentResult result;
  Tally all;
  const int features = bench.featureCounts()[1];
  std::size_t most_live = 0;
  for (const std::string& name : bench.testBedSequences()) {
    RecordingOptions options;
    options.every = 4;
    options.features = bench.featureCounts().back();
    options.problems = bench.quick() ? 4 : 8;
    const Sequence& sequence = bench.sequence(name);
    for (const RecordedProblem& whole : bench.recording(name, options).problems) {
      const RecordedProblem problem = spreadFeatures(whole, features);
      const MatchingTrial trial = tryMatcher(sequence, problem, matcherVariant("active"), true);
      if (!isAmbiguous(trial)) continue;
      const MatchingTrial free = tryMatcher(sequence, problem, unpruned(), true);
      const std::vector<MatchStep>& trace = trial.result.trace;
      const MatchStatistics& s = trial.result.statistics;
      ++all.frames;
      all.less_area += s.pixels_searched < s.pixels_full_gates;
      all.same += sameAssociations(trial, free);
      all.weight += s.accepted_weight;
      all.pixels += static_cast<double>(s.pixels_searched);
      all.gates += static_cast<double>(s.pixels_full_gates);
      all.live += static_cast<double>(trace.back().pruned.size());
      const auto insignificantIn = [](const MatchStep& step) {
        return static_cast<int>(std::count_if(
            step.weights.begin(), step.weights.end(),
            [](const MatchStep::GaussianWeight& one) { return one.weight < kInsignificant; }));
      };
      const std::vector<MatchStep>& free_trace = free.result.trace;
      all.live_unpruned += static_cast<double>(free_trace.back().weights.size());
      all.insignificant += insignificantIn(free_trace.back());
      for (std::size_t k = 0; k < trace.size(); ++k) {
        const MatchStep& step = trace[k];
        double heaviest = 0.0;
        for (const auto& one : step.pruned) heaviest = std::max(heaviest, one.weight);
        const bool has_free = k < free_trace.size();
        table.add({name, problem.image, static_cast<int>(k), step.feature, step.gaussian,
                   step.area_px, static_cast<int>(step.matches.size()),
                   static_cast<int>(step.pruned.size()),
                   has_free ? Cell(static_cast<int>(free_trace[k].weights.size())) : Cell(""),
                   has_free ? Cell(insignificantIn(free_trace[k])) : Cell(""), heaviest});
      }
      const auto peak = std::max_element(
          trace.begin(), trace.end(),
          [](const MatchStep& a, const MatchStep& b) { return a.pruned.size() < b.pruned.size(); });
      if (name != bench.mainSequence() || peak->pruned.size() <= most_live) continue;
      most_live = peak->pruned.size();
      const auto peak_step = static_cast<std::size_t>(peak - trace.begin()) + 1;
      const cv::Mat& image = sequence.images[static_cast<std::size_t>(problem.image)];
      const MatchReplay replay(trial);
      std::vector<cv::Mat> panels;
      for (const std::size_t k : std::set<std::size_t>{
               0, 1, peak_step, std::min(peak_step + 1, trace.size()), trace.size()})
        panels.push_back(drawStep(image, problem.prior, replay, trace, k));
      panels.push_back(drawSearched(image, problem.prior, trace,
                                    static_cast<double>(s.pixels_searched),
                                    static_cast<double>(s.pixels_full_gates)));
      result.pictures = {{"", tilePictures(panels, 2)}, {"weights", drawWeights(free_trace)}};
    }
  }
  result.tables.emplace_back("", table);
  if (all.frames == 0) return result;
  result.findings.push_back({"ambiguous frames: weight of the accepted Gaussian, mean",
                             "the ambiguity is resolved",
                             text("%.3f (%d frames)", all.weight / all.frames, all.frames),
                             verdict(all.weight > 0.9 * all.frames)});
  result.findings.push_back(
      {"ambiguous frames: area searched, of that of all ellipses of the prediction",
       "less in this example; 12 to 15 % in table 5.2",
       text("%.1f %%; less in %d of %d", 100.0 * all.pixels / all.gates, all.less_area, all.frames),
       verdict(all.less_area == all.frames)});
  result.findings.push_back(
      {"without pruning: Gaussians in the end, and those of less than 0.001 weight; with it: all",
       "saturated with many of insignificant weight",
       text("%.1f, %.1f; %.1f", all.live_unpruned / all.frames, all.insignificant / all.frames,
            all.live / all.frames),
       verdict(all.insignificant > 0.5 * all.live_unpruned)});
  result.findings.push_back({"frames with the same associations with and without pruning",
                             "faster at no expense", text("%d of %d", all.same, all.frames),
                             verdict(all.same == all.frames)});
  return result;
}

}  // namespace active_matching_slam
