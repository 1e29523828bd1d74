/// reproduce: runs the experiments of the thesis (Chli 2009, chapters 4 to 7) on simulated and
/// recorded sequences, and writes tables, plots, and the thesis's figures beside those found here.

#include <sys/utsname.h>

#include <boost/filesystem.hpp>
#include <boost/program_options.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "active_matching_slam/evaluation/text_file.h"
#include "active_matching_slam/experiments/experiment.h"
#include "common/tool_main.h"

namespace active_matching_slam {
namespace {

namespace fs = boost::filesystem;
namespace po = boost::program_options;

struct Arguments {
  std::string name, data, output;
  bool quick = false, show_help = false;
};

po::options_description describeOptions(Arguments* a) {
  po::options_description options("reproduce NAME|all [--data DIR] [--quick] --output DIR", 100);
  options.add_options()                                        //
      ("help,h", po::bool_switch(&a->show_help), "this text")  //
      ("name", po::value(&a->name), "the experiment, or all")  //
      ("data", po::value(&a->data),
       "folder of the recorded sequences; without it, simulated ones alone")  //
      ("quick", po::bool_switch(&a->quick),
       "short sequences of small images: minutes for all, in place of an hour")  //
      ("output,o", po::value(&a->output),
       "directory for the tables (csv), plots (png) and findings");
  return options;
}

Arguments parseArguments(int argc, char** argv) {
  Arguments arguments;
  const po::options_description options = describeOptions(&arguments);
  po::positional_options_description positional;
  positional.add("name", 1);
  po::variables_map values;
  po::store(po::command_line_parser(argc, argv).options(options).positional(positional).run(),
            values);
  po::notify(values);
  if (arguments.show_help) {
    std::cout << options << "\nexperiments\n";
    for (const NamedChoice& choice : experimentChoices())
      std::cout << "  " << std::left << std::setw(14) << choice.name << choice.description << '\n';
    return arguments;
  }
  if (arguments.name.empty()) throw std::runtime_error("name an experiment, or all (see --help)");
  if (arguments.output.empty()) throw std::runtime_error("--output is missing: where to write");
  if (arguments.name != "all") checkChoice("experiment", arguments.name, experimentChoices());
  return arguments;
}

/// What the durations were measured on, and how.
std::string machineText(bool quick) {
  std::string processor = "unknown processor";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0) {
      processor = line.substr(line.find(':') + 2);
      break;
    }
  utsname system{};
  uname(&system);
  return "mode: " + std::string(quick ? "quick" : "full") + "\nprocessor: " + processor + ", " +
         std::to_string(std::thread::hardware_concurrency()) + " cores\nsystem: " + system.sysname +
         " " + system.release + " " + system.machine + "\ncompiler: " + __VERSION__ + "\n";
}

void printFindings(const ExperimentResult& result) {
  for (const Finding& finding : result.findings) {
    const std::string verdict = verdictName(finding.verdict);
    std::printf("  %s\n    thesis: %s\n    here:   %s%s\n", finding.quantity.c_str(),
                finding.thesis.c_str(), finding.here.c_str(),
                verdict.empty() ? "" : (" (" + verdict + ")").c_str());
  }
  std::fflush(stdout);
}

void run(const Arguments& arguments) {
  boost::system::error_code error;
  fs::create_directories(arguments.output, error);
  if (error) throw std::runtime_error(arguments.output + ": " + error.message());
  std::vector<NamedChoice> chosen;
  for (const NamedChoice& choice : experimentChoices())
    if (arguments.name == "all" || arguments.name == choice.name) chosen.push_back(choice);

  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::size_t done = 0;
  LaboratorySettings settings;
  settings.data = arguments.data;
  settings.quick = arguments.quick;
  settings.progress = [&](const std::string& what) {
    std::fprintf(stderr, "reproduce [%zu of %zu, %4.0f s] %s\n", done + 1, chosen.size(), seconds(),
                 what.c_str());
  };
  Laboratory laboratory(settings);
  writeTextFile(arguments.output + "/machine.txt", machineText(arguments.quick));
  for (const NamedChoice& choice : chosen) {
    settings.progress(choice.name + ": " + choice.description);
    const ExperimentResult result = laboratory.run(choice.name);
    writeResult(arguments.output, choice.name, result);
    std::printf("%s: %s\n", choice.name.c_str(), choice.description.c_str());
    printFindings(result);
    ++done;
  }
  std::printf("written to %s in %.0f s\n", arguments.output.c_str(), seconds());
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  return runTool("reproduce", [&] {
    const Arguments arguments = parseArguments(argc, argv);
    if (!arguments.show_help) run(arguments);
    return 0;
  });
}
