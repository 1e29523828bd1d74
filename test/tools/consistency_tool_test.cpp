// Runs the executable (its path is compiled in as CONSISTENCY) on two short runs.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "support/run_program.h"

namespace {

int runConsistency(const std::string& arguments, std::string* output) {
  const auto outcome = active_matching_slam::runProgram(CONSISTENCY, arguments);
  *output = outcome.output;
  return outcome.status;
}

TEST(ConsistencyTool, PrintsATableAndWritesARowForEachFrame) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("ams_consistency_" + std::to_string(getpid()));
  std::string output;
  ASSERT_EQ(
      runConsistency("--runs 2 --seconds 1 --width 160 --height 120 --output " + folder.string(),
                     &output),
      0)
      << output;
  // 95 % of chi-square with 12 degrees of freedom, over the two runs.
  EXPECT_NE(output.find("over 2 runs (6 expected), 95 % bounds 2.20 to 11.67"), std::string::npos)
      << output;
  EXPECT_NE(output.find("frames not tracked: 0;"), std::string::npos) << output;
  std::ifstream file(folder / "consistency.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "time_s,mean_nees,lower_bound,upper_bound");
  int rows = 0;
  while (std::getline(file, line)) ++rows;
  EXPECT_GE(rows, 30);
  EXPECT_TRUE(std::filesystem::exists(folder / "consistency.png"));
  std::filesystem::remove_all(folder);
}

TEST(ConsistencyTool, DrawsCalibrationsThatAreOff) {
  const std::string run = "--runs 1 --seconds 2 --width 160 --height 120";
  std::string exact, drawn, again;
  ASSERT_EQ(runConsistency(run, &exact), 0) << exact;
  ASSERT_EQ(runConsistency(run + " --draw-calibration", &drawn), 0) << drawn;
  ASSERT_EQ(runConsistency(run + " --draw-calibration", &again), 0) << again;
  EXPECT_NE(exact, drawn);
  EXPECT_EQ(drawn, again);
}

TEST(ConsistencyTool, SaysWhatIsOutOfRange) {
  std::string output;
  EXPECT_EQ(runConsistency("--runs 0", &output), 2);
  EXPECT_NE(output.find("--runs must be 1 to 1000"), std::string::npos) << output;
  EXPECT_EQ(runConsistency("--scene nowhere", &output), 2);
  EXPECT_NE(output.find("nowhere"), std::string::npos) << output;
}

}  // namespace
