// Figures 5.14 and 5.15: how the information that AM expects of its next measurement falls during
// the matching of a frame, its discrete and its continuous part.

#include <algorithm>

#include "workbench.h"

namespace active_matching_slam {
namespace {

/// Means over frames, by step; a frame that is done counts with nothing.
struct Evolution {
  std::vector<double> discrete_bits, continuous_bits;
  double start_bits = 0.0;  ///< sum over the features of I(z_i; all others)
  int frames = 0;

  double total(std::size_t step) const {
    return step < discrete_bits.size() ? discrete_bits[step] + continuous_bits[step] : 0.0;
  }
  /// Steps until half of all the bits that the steps expect are spent.
  std::size_t halfTime() const {
    double all = 0.0, spent = 0.0;
    for (std::size_t k = 0; k < discrete_bits.size(); ++k) all += total(k);
    std::size_t step = 0;
    while (step < discrete_bits.size() && spent < 0.5 * all) spent += total(step++);
    return step;
  }
  double discreteSum() const {
    double sum = 0.0;
    for (const double bits : discrete_bits) sum += std::max(0.0, bits);
    return sum;
  }
};

Evolution evolutionOf(const Sequence& sequence, const std::vector<RecordedProblem>& problems,
                      int features) {
  Evolution mean;
  for (const RecordedProblem& problem : problems) {
    const MatchingTrial trial = tryMatcher(sequence, spreadFeatures(problem, features),
                                           matcherVariant("active"), /*keep_trace=*/true);
    const std::vector<MatchStep>& trace = trial.result.trace;
    if (trace.size() > mean.discrete_bits.size()) {
      mean.discrete_bits.resize(trace.size(), 0.0);
      mean.continuous_bits.resize(trace.size(), 0.0);
    }
    for (std::size_t k = 0; k < trace.size(); ++k) {
      mean.discrete_bits[k] += trace[k].discrete_information_bits;
      mean.continuous_bits[k] += trace[k].continuous_information_bits;
    }
    mean.start_bits += trial.result.statistics.information_bits_start;
    ++mean.frames;
  }
  const double frames = std::max(1, mean.frames);
  for (auto* bits : {&mean.discrete_bits, &mean.continuous_bits})
    for (double& value : *bits) value /= frames;
  mean.start_bits /= frames;
  return mean;
}

cv::Mat drawParts(const std::string& title, const Evolution& evolution) {
  BarChart chart{title, "matching step", "bits", {"continuous", "discrete"}, {}};
  for (std::size_t k = 0; k < std::min<std::size_t>(40, evolution.discrete_bits.size()); ++k)
    chart.bars.push_back({k % 5 == 0 ? std::to_string(k) : "",
                          {evolution.continuous_bits[k], evolution.discrete_bits[k]}});
  return drawBarChart(chart);
}

}  // namespace

ExperimentResult runInformationSteps(Workbench& bench) {
  const std::vector<int> counts =
      bench.quick() ? std::vector<int>{11, 30, 60} : std::vector<int>{11, 30, 50, 70};
  Table table({"sequence", "rate_hz", "features", "step", "discrete_bits", "continuous_bits"});
  ExperimentResult result;
  std::vector<cv::Mat> pictures;
  std::vector<double> first_bits;
  std::size_t half_time = 0, all_steps = 0;
  std::string discrete_here;
  double discrete_at_fastest = 0.0, discrete_at_slowest = 0.0;
  for (const std::string& name : bench.testBedSequences()) {
    const bool is_main = name == bench.mainSequence();
    for (const int every : {1, 4}) {
      RecordingOptions options;
      options.every = every;
      options.features = bench.featureCounts().back();
      options.problems = bench.quick() ? 4 : 8;
      const Recording& recording = bench.recording(name, options);
      const double rate_hz = 30.0 / every;
      bench.say(text("information by step, %s at %.4g Hz", name.c_str(), rate_hz));
      LineChart lines{text("Expected information by step, %s, %.4g Hz", name.c_str(), rate_hz),
                      "matching step", "bits"};
      lines.markers = false;
      for (const int features : counts) {
        const Evolution evolution = evolutionOf(bench.sequence(name), recording.problems, features);
        ChartSeries series{std::to_string(features) + " features", {}};
        for (std::size_t k = 0; k < evolution.discrete_bits.size(); ++k) {
          table.add({name, rate_hz, features, static_cast<int>(k), evolution.discrete_bits[k],
                     evolution.continuous_bits[k]});
          series.points.emplace_back(k, evolution.total(k));
        }
        lines.series.push_back(series);
        if (features == counts.back()) {
          (every == 1 ? discrete_at_fastest : discrete_at_slowest) += evolution.discreteSum();
          if (is_main)
            pictures.push_back(
                drawParts(text("%d features, %.4g Hz", features, rate_hz), evolution));
        }
        if (is_main && every == 1) {
          first_bits.push_back(evolution.start_bits);
          half_time = evolution.halfTime();
          all_steps = evolution.discrete_bits.size();
        }
      }
      if (is_main) pictures.push_back(drawLineChart(lines));
    }
  }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures(pictures, 2));
  std::string starts;
  for (std::size_t i = 0; i < first_bits.size(); ++i)
    starts += text("%s%d: %.0f", i ? "; " : "", counts[i], first_bits[i]);
  result.findings.push_back({"information in the prior by number of features [bits]",
                             "more features, more bits", starts,
                             verdict(std::is_sorted(first_bits.begin(), first_bits.end()))});
  result.findings.push_back({"steps that expect half of all the bits, most features, fastest rate",
                             "tails off early", text("%zu of %zu", half_time, all_steps),
                             verdict(4 * half_time < all_steps)});
  result.findings.push_back(
      {"discrete information a frame, all sequences, slowest against fastest rate [bits]",
       "appears with ambiguity",
       text("%.2f against %.2f", discrete_at_slowest, discrete_at_fastest),
       verdict(discrete_at_slowest > discrete_at_fastest)});
  return result;
}

}  // namespace active_matching_slam
