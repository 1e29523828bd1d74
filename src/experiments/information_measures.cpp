// Figure 4.4: what a measurement tells of the other measurements of the frame, and what it tells of
// the camera's state. New features inherit the camera's uncertainty without having much in common
// with the rest yet.

#include <algorithm>
#include <cmath>
#include <numeric>

#include "workbench.h"

namespace active_matching_slam {
namespace {

/// Features of a frame from which on ranks say something. Derivation: a tenth of them is one.
constexpr std::size_t kFewestFeatures = 10;

/// Of the features that a frame measures, in the order of their age, eldest first.
struct FrameMeasures {
  std::vector<double> of_features, of_camera;  // [bit]
};

FrameMeasures measuresOf(const TrackedFrame& frame) {
  FrameMeasures measures;
  const auto bits_of = predictedInformationBits(frame);
  for (const TrackedFeature& feature : frame.features) {
    const auto bits = bits_of.find(feature.id);
    if (bits == bits_of.end() || !(feature.camera_bits > 0.0)) continue;
    measures.of_features.push_back(bits->second);
    measures.of_camera.push_back(feature.camera_bits);
  }
  return measures;
}

/// Pearson's.
double correlation(const std::vector<double>& x, const std::vector<double>& y) {
  const auto mean = [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
  };
  const double mx = mean(x), my = mean(y);
  double xx = 0.0, yy = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mx) * (x[i] - mx);
    yy += (y[i] - my) * (y[i] - my);
    xy += (x[i] - mx) * (y[i] - my);
  }
  return xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;
}

/// Mean rank of the newest tenth: 0 where they are worth most, 1 where least; 0.5 by chance.
double rankOfNewest(const std::vector<double>& bits) {
  const std::size_t newest = std::max<std::size_t>(1, bits.size() / 10);
  double sum = 0.0;
  for (std::size_t i = bits.size() - newest; i < bits.size(); ++i)
    sum += static_cast<double>(
        std::count_if(bits.begin(), bits.end(), [&](double other) { return other > bits[i]; }));
  return sum / static_cast<double>(newest * (bits.size() - 1));
}

}  // namespace

ExperimentResult runInformationMeasures(Workbench& bench) {
  Table table({"sequence", "frame", "features", "correlation", "rank_of_newest_by_features",
               "rank_of_newest_by_camera"});
  ExperimentResult result;
  LineChart chart{"Rank of the newest tenth of the features (0: most bits)", "frame", "rank"};
  chart.markers = false;
  for (const char* name : {"office_slow", "walkway_straight"}) {
    const Sequence& sequence = bench.sequence(name);
    bench.say(text("information measures in %s", name));
    ChartSeries by_features{text("%s: by MI with the others", name), {}},
        by_camera{text("%s: by MI with the camera", name), {}};
    double correlations = 0.0, of_features = 0.0, of_camera = 0.0;
    int frames = 0;
    trackSequence(sequence, referenceOptions(sequence, bench.quick() ? 20 : 30), 1,
                  [&](const TrackedFrame& frame, int) {
                    const FrameMeasures measures = measuresOf(frame);
                    if (measures.of_features.size() < kFewestFeatures) return;
                    const double r = correlation(measures.of_features, measures.of_camera);
                    const double f = rankOfNewest(measures.of_features),
                                 c = rankOfNewest(measures.of_camera);
                    table.add({name, static_cast<int>(frame.index),
                               static_cast<int>(measures.of_features.size()), r, f, c});
                    by_features.points.emplace_back(frame.index, f);
                    by_camera.points.emplace_back(frame.index, c);
                    correlations += r;
                    of_features += f;
                    of_camera += c;
                    ++frames;
                  });
    if (frames == 0) continue;
    chart.series.push_back(by_features);
    chart.series.push_back(by_camera);
    result.findings.push_back(
        {text("%s: correlation of MI with the others and MI with the camera", name),
         "not the same measure", text("%.2f", correlations / frames),
         verdict(correlations / frames < 0.9)});
    result.findings.push_back(
        {text("%s: rank of the newest features by MI with the others, with the camera", name),
         "last (15th of 15); first",
         text("%.2f; %.2f (0: first, 1: last)", of_features / frames, of_camera / frames),
         verdict(of_camera < of_features)});
  }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", drawLineChart(chart));
  return result;
}

}  // namespace active_matching_slam
