#include "test_bed_charts.h"

namespace active_matching_slam {
namespace {

ChartBar timesOf(const std::string& name, const TrialSummary& s) {
  return {name, {s.correlation_ms, s.information_ms, s.update_ms, s.tree_ms}};
}

BarChart timesChart(const std::string& title, const std::string& x_label) {
  return {title,
          x_label,
          "ms a frame",
          {"correlation", "information", "update or resolve", "tree"},
          {}};
}

}  // namespace

cv::Mat chartByFeatures(Workbench& bench, const std::string& title, const std::string& y_label,
                        double rate_hz, const std::vector<std::string>& matchers, CellValue value,
                        bool log_y) {
  LineChart chart{title, "features", y_label};
  chart.log_y = log_y;
  for (const std::string& matcher : matchers) {
    chart.series.push_back({matcher, {}});
    for (const int features : bench.featureCounts())
      if (const auto* cell = bench.cell(bench.mainSequence(), rate_hz, features, matcher))
        chart.series.back().points.emplace_back(features, value(cell->summary));
  }
  return drawLineChart(chart);
}

cv::Mat chartByRate(Workbench& bench, const std::string& title, const std::string& y_label,
                    int features, const std::vector<std::string>& matchers, CellValue value,
                    bool log_y) {
  LineChart chart{title, "frame rate [Hz]", y_label, true};
  chart.log_y = log_y;
  for (const std::string& matcher : matchers) {
    chart.series.push_back({matcher, {}});
    for (const int every : bench.everies())
      if (const auto* cell = bench.cell(bench.mainSequence(), 30.0 / every, features, matcher))
        chart.series.back().points.emplace_back(30.0 / every, value(cell->summary));
  }
  return drawLineChart(chart);
}

cv::Mat timesByFeatures(Workbench& bench, const std::string& matcher, double rate_hz) {
  BarChart chart = timesChart(text("%s, %.4g Hz", matcher.c_str(), rate_hz), "features");
  for (const int features : bench.featureCounts())
    if (const auto* cell = bench.cell(bench.mainSequence(), rate_hz, features, matcher))
      chart.bars.push_back(timesOf(std::to_string(features), cell->summary));
  return drawBarChart(chart);
}

cv::Mat timesByRate(Workbench& bench, const std::string& matcher, int features) {
  BarChart chart =
      timesChart(text("%s, %d features", matcher.c_str(), features), "frame rate [Hz]");
  for (const int every : bench.everies())
    if (const auto* cell = bench.cell(bench.mainSequence(), 30.0 / every, features, matcher))
      chart.bars.push_back(timesOf(text("%.4g", 30.0 / every), cell->summary));
  return drawBarChart(chart);
}

std::vector<double> ratiosByRate(Workbench& bench, int features, const std::string& a,
                                 const std::string& b, CellValue value) {
  std::vector<double> ratios;
  for (const int every : bench.everies()) {
    const auto* of_a = bench.cell(bench.mainSequence(), 30.0 / every, features, a);
    const auto* of_b = bench.cell(bench.mainSequence(), 30.0 / every, features, b);
    if (of_a && of_b) ratios.push_back(value(of_a->summary) / value(of_b->summary));
  }
  return ratios;
}

std::string byRateText(Workbench& bench, const std::vector<double>& values, const char* format) {
  std::string result;
  const std::vector<int> everies = bench.everies();
  for (std::size_t i = 0; i < values.size() && i < everies.size(); ++i) {
    char number[64];
    std::snprintf(number, sizeof(number), format, values[i]);
    result += text("%s%.4g Hz: %s", i ? "; " : "", 30.0 / everies[i], number);
  }
  return result;
}

bool isRising(const std::vector<double>& values) {
  for (std::size_t i = 1; i < values.size(); ++i)
    if (!(values[i] >= values[i - 1])) return false;
  return values.size() > 1;
}

}  // namespace active_matching_slam
