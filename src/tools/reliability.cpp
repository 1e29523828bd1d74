// Is the weight of the accepted hypothesis a probability? Thousands of simulated frames, hard ones
// among them: a table, reliability.csv and reliability.png.

#include "active_matching_slam/evaluation/reliability.h"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/plot_canvas.h"
#include "common/tool_main.h"

namespace active_matching_slam {
namespace {

namespace po = boost::program_options;
using Bins = std::vector<ReliabilityBin>;

void printTable(const Bins& bins) {
  std::printf("%8s %12s %16s %10s\n", "frames", "mean weight", "fraction correct", "sigma");
  for (const ReliabilityBin& bin : bins)
    if (bin.frames > 0)
      std::printf("%8d %12.3f %16.3f %10.3f\n", bin.frames, bin.mean_weight, bin.fraction_correct,
                  bin.sigma);
}

void writeCsv(const Bins& bins, const std::string& path) {
  std::ofstream file(path);
  file << "frames,mean_weight,fraction_correct,sigma\n";
  for (const ReliabilityBin& bin : bins)
    file << bin.frames << ',' << bin.mean_weight << ',' << bin.fraction_correct << ',' << bin.sigma
         << '\n';
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

void writePlot(const Bins& bins, const std::string& title, const std::string& path) {
  constexpr int kSide = 480, kLeft = 70, kTop = 40;
  const cv::Scalar grey(150, 150, 150), blue(180, 90, 20);
  cv::Mat image(kTop + kSide + 60, kLeft + kSide + 30, CV_8UC3, cv::Scalar(255, 255, 255));
  PlotCanvas canvas(&image, cv::Rect(kLeft, kTop, kSide, kSide), {0.5, 0.5}, kSide / 1.1);
  canvas.drawGrid("weight of the accepted hypothesis", "fraction correct", title);
  canvas.polyline({{0.0, 0.0}, {1.0, 1.0}}, grey, 1);
  for (const ReliabilityBin& bin : bins) {
    if (bin.frames == 0) continue;
    const Eigen::Vector2d point(bin.mean_weight, bin.fraction_correct), bar(0.0, 2.0 * bin.sigma);
    canvas.polyline({point - bar, point + bar}, blue, 1);
    canvas.dot(point, 4.0, blue);
  }
  canvas.drawFrame();
  if (!cv::imwrite(path, image)) throw std::runtime_error(path + ": cannot be written");
}

int run(int argc, char** argv) {
  std::string matcher, output;
  int frames = 0, bins = 0;
  std::uint64_t seed = 0;
  po::options_description options("reliability [options]", 100);
  auto add = options.add_options();
  add("help,h", "this text");
  add("matcher", po::value(&matcher)->default_value("active"), "active, fast_active or chow_liu");
  add("frames", po::value(&frames)->default_value(4000), "simulated frames, of four kinds in turn");
  add("bins", po::value(&bins)->default_value(10), "of equal width between weights 0 and 1");
  add("seed", po::value(&seed)->default_value(1), "of the frames");
  add("output", po::value(&output), "directory for reliability.csv and reliability.png");
  po::variables_map values = readArguments(argc, argv, options);
  if (values.count("help")) {
    std::cout
        << options
        << "Prints, by weight of the accepted hypothesis, how often it was right. 'sigma' is\n"
           "the standard deviation of that fraction if the weights are probabilities.\n";
    return 0;
  }
  po::notify(values);
  if (frames < 1) throw std::runtime_error("--frames must be at least 1");
  if (bins < 1 || bins > 1000) throw std::runtime_error("--bins must be 1 to 1000");
  const Bins measured = measureReliability(matcher, frames, bins, seed).bins();
  printTable(measured);
  if (output.empty()) return 0;
  std::filesystem::create_directories(output);
  writeCsv(measured, output + "/reliability.csv");
  writePlot(measured, matcher + ", " + std::to_string(frames) + " frames, 2 sigma",
            output + "/reliability.png");
  std::printf("written to %s\n", output.c_str());
  return 0;
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  return runTool("reliability", [&] { return run(argc, argv); });
}
