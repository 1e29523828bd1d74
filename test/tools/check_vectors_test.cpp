// Runs the executable (its path is compiled in as CHECK_VECTORS) on a folder of its own making.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "support/run_program.h"

namespace {

active_matching_slam::ProgramOutcome run(const std::string& arguments) {
  return active_matching_slam::runProgram(CHECK_VECTORS, arguments);
}

class CheckVectors : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("ams_vectors_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// A feature with one match, and what is claimed to be its nearest.
  void write(const std::string& name, int nearest) const {
    std::ofstream(folder_ / name)
        << R"({"format": 1, "input": {"F": 1, "R": 1.0, "z": [10, 10], "S": [[4, 0], [0, 4]],
               "Ptp": [0.9], "Pfp": [1e-5], "candidates": [[[11, 10]]], "scores": [[0.9]]},
               "nearest": [)"
        << nearest << "]}";
  }

  std::filesystem::path folder_;
};

TEST_F(CheckVectors, PrintsALineForEachAndTheCountsLast) {
  write("a.json", 0);
  write("b.json", -1);
  const active_matching_slam::ProgramOutcome outcome = run(folder_.string());
  EXPECT_EQ(1, outcome.status);
  EXPECT_EQ(
      "passed  a  (1 values compared)\n"
      "FAILED  b  (1 values compared, 1 differ)\n"
      "        nearest is [0], must be [-1]\n"
      "1 passed, 1 failed\n",
      outcome.output);
}

TEST_F(CheckVectors, SucceedsOnlyWhenAllPass) {
  EXPECT_EQ(1, run(folder_.string()).status) << "an empty folder";
  write("a.json", 0);
  EXPECT_EQ(0, run(folder_.string()).status);
  std::ofstream(folder_ / "c.json") << "{";
  EXPECT_EQ(1, run(folder_.string()).status);
}

TEST_F(CheckVectors, SaysWhatIsWrongWithItsUse) {
  EXPECT_EQ(0, run("--help").status);
  EXPECT_EQ(2, run("").status);
  EXPECT_EQ(2, run("/no/such/folder").status);
}

}  // namespace
