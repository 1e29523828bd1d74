#include "active_matching_slam/matching/golden_vectors.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

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

}  // namespace
}  // namespace active_matching_slam
