/// check_vectors FOLDER: runs the matchers on every golden vector of a folder; a line for each, and
/// the counts last. Returns 0 when all passed, 1 when one failed, 2 for wrong use.

#include <exception>
#include <iostream>

#include "active_matching_slam/matching/golden_vectors.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: check_vectors FOLDER\n";
    return 2;
  }
  constexpr std::size_t kShown = 5;
  int passed = 0, failed = 0;
  try {
    for (const std::string& path : active_matching_slam::goldenVectorsIn(argv[1])) {
      const auto report = active_matching_slam::checkGoldenVector(path);
      ++(report.passed() ? passed : failed);
      std::cout << (report.passed() ? "passed  " : "FAILED  ") << report.name << "  ("
                << report.compared << " values compared";
      if (!report.passed()) std::cout << ", " << report.differences.size() << " differ";
      std::cout << ")\n";
      for (std::size_t i = 0; i < report.differences.size() && i < kShown; ++i)
        std::cout << "        " << report.differences[i] << '\n';
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  std::cout << passed << " passed, " << failed << " failed\n";
  return failed == 0 && passed > 0 ? 0 : 1;
}
