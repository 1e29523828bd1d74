// Is the covariance of the pose honest? Many simulated runs of the tracker, each with another seed:
// by time, the mean of the normalised estimation error squared (NEES) and its chi-square bounds
// (Bar-Shalom, Li, Kirubarajan 2001, section 5.4): a table, consistency.csv and consistency.png.

#include "active_matching_slam/evaluation/consistency.h"

#include <algorithm>
#include <atomic>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "active_matching_slam/evaluation/chart.h"
#include "active_matching_slam/evaluation/run_summary.h"
#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"
#include "common/tool_main.h"

namespace active_matching_slam {
namespace {

namespace po = boost::program_options;

constexpr int kDegrees = 6;
constexpr int kParts = 6;  ///< of the time, in the table

struct Arguments {
  SimulatorOptions simulator;
  int runs = 30, threads = 2;
  bool draw_calibration = false;
  std::string output;
};

struct Run {
  std::vector<double> nees;  ///< one a frame
  RunSummary summary;
  double path_m = 0.0;
};

/// The calibration as somebody might have measured it: off by errors drawn from the filter's prior.
CameraModel drawCalibration(const CameraModel& camera, const FilterOptions& options,
                            std::uint64_t seed) {
  Random random = Random(seed).fork(0x43414C49);
  const auto normal = [&] {  // Box and Muller
    const double length = std::sqrt(-2.0 * std::log(1.0 - random.uniform()));
    return length * std::cos(2.0 * M_PI * random.uniform());
  };
  CameraCalibration c = camera.calibration();
  const double larger = std::exp(options.initial_sigma_focal * normal());
  c.cx += options.initial_sigma_centre * c.fx * normal();
  c.cy += options.initial_sigma_centre * c.fy * normal();
  c.fx *= larger;
  c.fy *= larger;
  return CameraModel(c);
}

Run trackRun(const Arguments& arguments, int index) {
  SimulatorOptions options = arguments.simulator;
  options.seed += static_cast<std::uint64_t>(index);
  Simulator simulator(options);
  const TrackerOptions defaults;
  Tracker tracker(arguments.draw_calibration
                      ? drawCalibration(simulator.camera(), defaults.filter, options.seed)
                      : simulator.camera(),
                  defaults);
  std::vector<FrameRecord> records;
  RunTruth truth;
  truth.simulated = true;
  while (const auto image = simulator.next()) {
    records.push_back(recordOf(*tracker.track(image->image, image->stamp_s)));
    truth.trajectory.push_back({image->stamp_s, image->truth.T_world_camera});
  }
  return {frameErrors(records, truth).pose_nees, summarise(records, truth),
          measureExcursion(truth.trajectory).path_length};
}

std::vector<Run> trackRuns(const Arguments& arguments) {
  std::vector<Run> runs(static_cast<std::size_t>(arguments.runs));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int i = next++; i < arguments.runs; i = next++) {
      runs[i] = trackRun(arguments, i);
      std::fprintf(stderr, "run %d of %d\n", i + 1, arguments.runs);
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < arguments.threads; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  return runs;
}

std::vector<double> meanNees(const std::vector<Run>& runs) {
  std::vector<std::vector<double>> nees;
  for (const Run& run : runs) nees.push_back(run.nees);
  return meanOverRuns(nees);
}

void printTable(const std::vector<Run>& runs, const std::vector<double>& mean,
                const ChiSquareBounds& bounds, double rate_hz) {
  std::printf("mean NEES of the pose over %zu runs (%d expected), 95 %% bounds %.2f to %.2f\n",
              runs.size(), kDegrees, bounds.lower, bounds.upper);
  std::printf("%14s %8s %8s %8s %8s\n", "seconds", "mean", "within", "below", "above");
  const auto row = [&](std::size_t begin, std::size_t end) {
    double sum = 0.0, below = 0.0, above = 0.0, count = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      if (!std::isfinite(mean[i])) continue;
      ++count;
      sum += mean[i];
      below += mean[i] < bounds.lower;
      above += mean[i] > bounds.upper;
    }
    if (count == 0.0) return;
    std::printf("%6.1f - %5.1f %8.2f %6.0f %% %6.0f %% %6.0f %%\n", begin / rate_hz, end / rate_hz,
                sum / count, 100.0 * (count - below - above) / count, 100.0 * below / count,
                100.0 * above / count);
  };
  for (std::size_t part = 0; part < kParts; ++part)
    row(mean.size() * part / kParts, mean.size() * (part + 1) / kParts);
  row(0, mean.size());

  double worst = 0.0, product = 0.0, largest = 0.0;
  int lost = 0;
  for (const Run& run : runs) {
    const double error =
        run.summary.ate_sim3_m.value_or(std::numeric_limits<double>::infinity()) / run.path_m;
    worst = std::max(worst, error);
    product += std::log(error) / static_cast<double>(runs.size());
    lost += run.summary.frames - run.summary.frames_tracked;
    largest = std::max(largest, run.summary.nees_mean.value_or(0.0));
  }
  std::printf(
      "frames not tracked: %d; ATE Sim(3) in the path's length: geometric mean %.3f %%, "
      "most %.3f %%; mean NEES of a run at most %.1f\n",
      lost, 100.0 * std::exp(product), 100.0 * worst, largest);
}

void write(const std::vector<double>& mean, const ChiSquareBounds& bounds,
           const Arguments& arguments) {
  const std::string& folder = arguments.output;
  std::filesystem::create_directories(folder);
  std::ofstream file(folder + "/consistency.csv");
  file << "time_s,mean_nees,lower_bound,upper_bound\n";
  LineChart chart;
  chart.title = arguments.simulator.scene + ", " + arguments.simulator.motion + ", " +
                std::to_string(arguments.runs) + " runs";
  chart.x_label = "time [s]";
  chart.y_label = "mean NEES of the pose";
  chart.markers = false;
  ChartSeries nees{"mean", {}}, band{"95 % bounds", {}};
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double time_s = static_cast<double>(i) / arguments.simulator.rate_hz;
    file << time_s << ',' << mean[i] << ',' << bounds.lower << ',' << bounds.upper << '\n';
    nees.points.emplace_back(time_s, std::min(mean[i], 3.0 * bounds.upper));
  }
  if (!file.flush()) throw std::runtime_error(folder + "/consistency.csv: cannot be written");
  const double end_s = static_cast<double>(mean.size()) / arguments.simulator.rate_hz;
  band.points = {{0.0, bounds.lower},
                 {end_s, bounds.lower},
                 {end_s, bounds.upper},
                 {0.0, bounds.upper},
                 {0.0, bounds.lower}};
  chart.series = {nees, band};
  writePicture(folder + "/consistency.png", drawLineChart(chart));
  std::printf("written to %s\n", folder.c_str());
}

int run(int argc, char** argv) {
  Arguments arguments;
  SimulatorOptions& s = arguments.simulator;
  po::options_description options("consistency [options]", 100);
  auto add = options.add_options();
  add("help,h", "this text");
  add("scene", po::value(&s.scene)->default_value(s.scene), "see simulate_bag --list");
  add("motion", po::value(&s.motion)->default_value(s.motion), "see simulate_bag --list");
  add("width", po::value(&s.width)->default_value(s.width), "of the image [px]");
  add("height", po::value(&s.height)->default_value(s.height), "of the image [px]");
  add("seconds", po::value(&s.duration_s)->default_value(s.duration_s), "length of a run");
  add("seed", po::value(&s.seed)->default_value(s.seed), "of the first run; the others follow");
  add("runs", po::value(&arguments.runs)->default_value(arguments.runs), "1 to 1000");
  add("threads", po::value(&arguments.threads)->default_value(arguments.threads), "1 to 64");
  add("draw-calibration", po::bool_switch(&arguments.draw_calibration),
      "track with a focal length and an image centre that are off by errors drawn from what the "
      "filter expects of them; else they are exact, and poses err less than it says");
  add("output", po::value(&arguments.output), "folder for consistency.csv and consistency.png");
  po::variables_map values = readArguments(argc, argv, options);
  if (values.count("help")) {
    std::cout
        << options
        << "Tracks simulated runs with the default settings and holds the errors of the pose\n"
           "against the filter's covariance.\n";
    return 0;
  }
  po::notify(values);
  if (arguments.runs < 1 || arguments.runs > 1000)
    throw std::invalid_argument("--runs must be 1 to 1000");
  if (arguments.threads < 1 || arguments.threads > 64)
    throw std::invalid_argument("--threads must be 1 to 64");
  checkSimulatorOptions(s);
  const std::vector<Run> runs = trackRuns(arguments);
  const std::vector<double> mean = meanNees(runs);
  const ChiSquareBounds bounds = chiSquareMeanBounds(kDegrees, arguments.runs);
  printTable(runs, mean, bounds, s.rate_hz);
  if (!arguments.output.empty()) write(mean, bounds, arguments);
  return 0;
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  return runTool("consistency", [&] { return run(argc, argv); });
}
