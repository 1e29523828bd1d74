// Recorded matching problems through the matchers, every step compared.

#include <exception>
#include <iostream>
#include <string>

#include "active_matching_slam/evaluation/golden_vectors.h"
#include "common/tool_main.h"

namespace {

constexpr const char* kUsage =
    "check_vectors FOLDER\n"
    "  Runs the matchers on every golden vector (*.json) of the folder. A line for each, the "
    "first\n"
    "  differences below it, and 'N passed, N failed' last. The exit status is 0 when all passed,\n"
    "  1 when one failed or there was none, 2 for wrong use.\n";

void print(const active_matching_slam::GoldenVectorReport& report) {
  constexpr std::size_t kShown = 5;
  std::cout << (report.passed() ? "passed  " : "FAILED  ") << report.name << "  ("
            << report.compared << " values compared";
  if (!report.passed()) std::cout << ", " << report.differences.size() << " differ";
  std::cout << ")\n";
  for (std::size_t i = 0; i < report.differences.size() && i < kShown; ++i)
    std::cout << "        " << report.differences[i] << '\n';
  std::cout << std::flush;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string argument = argc == 2 ? argv[1] : "";
  if (argument == "--help" || argument == "-h") {
    std::cout << kUsage;
    return 0;
  }
  if (argument.empty() || argument.front() == '-') {
    std::cerr << kUsage;
    return active_matching_slam::kToolFault;
  }
  return active_matching_slam::runTool("check_vectors", [&] {
    int passed = 0, failed = 0;
    for (const std::string& path : active_matching_slam::goldenVectorsIn(argument)) {
      const auto report = active_matching_slam::checkGoldenVector(path);
      print(report);
      ++(report.passed() ? passed : failed);
    }
    std::cout << passed << " passed, " << failed << " failed\n";
    return failed == 0 && passed > 0 ? 0 : 1;
  });
}
