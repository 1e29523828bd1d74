/// plot_benchmark: draws how the times of a Google Benchmark run grow with the first number in
/// each case's name, one curve for all that have the rest of the name in common.

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cctype>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>

#include "active_matching_slam/evaluation/chart.h"
#include "common/tool_main.h"

namespace ams = active_matching_slam;
namespace po = boost::program_options;

namespace {

/// "update/map:100/measured:30" is the case "update/measured:30" at 100.
struct Case {
  std::string curve;
  std::optional<double> size;
};

Case caseOf(const std::string& name) {
  Case result;
  std::istringstream parts(name);
  for (std::string part; std::getline(parts, part, '/');) {
    const std::string number =
        part.substr(part.find(':') == std::string::npos ? 0 : part.find(':') + 1);
    const bool is_number = !number.empty() && std::all_of(number.begin(), number.end(), [](char c) {
      return std::isdigit(static_cast<unsigned char>(c)) != 0;
    });
    if (is_number && !result.size)
      result.size = std::stod(number);
    else
      result.curve += (result.curve.empty() ? "" : "/") + part;
  }
  return result;
}

double microseconds(double time, const std::string& unit) {
  if (unit == "ns") return 1e-3 * time;
  if (unit == "ms") return 1e3 * time;
  if (unit == "s") return 1e6 * time;
  return time;
}

/// JSON is yaml.
YAML::Node loadRun(const std::string& path) {
  try {
    const YAML::Node run = YAML::LoadFile(path);
    if (run.IsMap() && run["benchmarks"]) return run["benchmarks"];
  } catch (const YAML::Exception&) {
  }
  throw std::runtime_error("'" + path + "' is no output of --benchmark_format=json");
}

int plot(int argc, char** argv) {
  std::string input, output, title;
  po::options_description options("plot_benchmark --input RUN.json --output PLOT.png [--title T]");
  options.add_options()        //
      ("help,h", "this text")  //
      ("input", po::value(&input)->required(),
       "output of a benchmark with --benchmark_format=json")     //
      ("output", po::value(&output)->required(), "the picture")  //
      ("title", po::value(&title)->default_value("processor time"), "above the picture");
  po::variables_map values = ams::readArguments(argc, argv, options);
  if (values.count("help")) {
    std::cout << options << '\n';
    return 0;
  }
  po::notify(values);
  std::map<std::string, ams::ChartSeries> curves;
  for (const YAML::Node& entry : loadRun(input)) {
    if (entry["run_type"] && entry["run_type"].as<std::string>() == "aggregate") continue;
    const Case one = caseOf(entry["name"].as<std::string>());
    if (!one.size || !entry["cpu_time"]) continue;
    ams::ChartSeries& curve = curves[one.curve];
    curve.name = one.curve;
    curve.points.emplace_back(*one.size, microseconds(entry["cpu_time"].as<double>(),
                                                      entry["time_unit"].as<std::string>()));
  }
  ams::LineChart chart{title, "size", "us", true, true};
  for (auto& [name, curve] : curves) {
    std::sort(curve.points.begin(), curve.points.end(),
              [](const auto& a, const auto& b) { return a.x() < b.x(); });
    if (curve.points.size() > 1) chart.series.push_back(curve);
  }
  if (chart.series.empty())
    throw std::runtime_error("'" + input + "' has no case in several sizes");
  ams::writePicture(output, ams::drawLineChart(chart, 960, 720));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return ams::runTool("plot_benchmark", [&] { return plot(argc, argv); });
}
