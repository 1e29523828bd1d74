#include "active_matching_slam/evaluation/golden_vectors.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace active_matching_slam {
namespace {

TEST(GoldenVectors, AreReproducedByEveryMatcher) {
  const char* data = std::getenv("AMS_DATA");
  const std::filesystem::path folder = std::filesystem::path(data ? data : "") / ".." / "vectors";
  if (!data || !std::filesystem::is_directory(folder)) GTEST_SKIP() << "AMS_DATA has no vectors";
  const auto paths = goldenVectorsIn(folder.string());
  EXPECT_FALSE(paths.empty());
  for (const std::string& path : paths) {
    const GoldenVectorReport report = checkGoldenVector(path);
    EXPECT_TRUE(report.passed()) << path << ": "
                                 << (report.differences.empty() ? "nothing was compared"
                                                                : report.differences.front());
  }
}

TEST(GoldenVectors, ReportAFileThatCannotBeRead) {
  EXPECT_FALSE(checkGoldenVector("no_such_file.json").passed());
}

/// Two features, one match each; what the matchers must bring is plain to see.
constexpr const char* kInput =
    R"("input": {"F": 2, "R": 1.0, "z": [10, 10, 50, 50], "S": [[4, 0, 3, 0], [0, 4, 0, 3],
       [3, 0, 4, 0], [0, 3, 0, 4]], "Ptp": [0.9, 0.9], "Pfp": [1e-5, 1e-5],
       "candidates": [[[11, 10]], [[51, 50.5]]], "scores": [[0.9], [0.8]], "true": [0, 0]})";

GoldenVectorReport reportOf(const std::string& content) {
  const auto path = std::filesystem::temp_directory_path() / "ams_golden_vector.json";
  std::ofstream(path) << content;
  GoldenVectorReport report = checkGoldenVector(path.string());
  std::filesystem::remove(path);
  return report;
}

std::string firstDifference(const std::string& content) {
  const GoldenVectorReport report = reportOf(content);
  return report.differences.empty() ? "" : report.differences.front();
}

TEST(GoldenVectors, PassOverPartsThatAreAbsentNullOrUnknown) {
  const GoldenVectorReport report =
      reportOf(std::string("{\"format\": 1, ") + kInput +
               R"(, "nearest": [0, 0], "am": null, "of_another_kind": {"steps": 3}})");
  EXPECT_TRUE(report.passed());
  EXPECT_EQ(1, report.compared);
}

TEST(GoldenVectors, NameWhatDiffersAndWhatIsMissing) {
  const std::string head = std::string("{\"format\": 1, ") + kInput;
  EXPECT_EQ("nearest is [0, 0], must be [0, -1]",
            firstDifference(head + R"(, "nearest": [0, -1]})"));
  EXPECT_EQ("jcbb.pairings is missing in the file",
            firstDifference(head + R"(, "jcbb": {"assoc": [0, 0]}})"));
  EXPECT_EQ("ransac1.inliers is not of the right type in the file",
            firstDifference(head + R"(, "ransac1": {"assoc": [0, 0], "inliers": "two"}})"));
  EXPECT_EQ("holds nothing to compare", firstDifference(head + "}"));
  EXPECT_EQ("input is missing", firstDifference(R"({"format": 1})"));
  EXPECT_EQ("format is not 1", firstDifference(R"({"format": 2})"));
  EXPECT_EQ("input.z has 1 entries, must have 2",
            firstDifference(R"({"format": 1, "input": {"F": 1, "R": 1, "z": [1], "S": [[1, 0],
                                [0, 1]]}})"));
  EXPECT_FALSE(reportOf("[1, 2").passed());
}

}  // namespace
}  // namespace active_matching_slam
