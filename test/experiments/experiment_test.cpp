#include "active_matching_slam/experiments/experiment.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace active_matching_slam {
namespace {

/// A table without its columns of durations, which depend on the machine.
std::string countsOf(const Table& table) {
  std::istringstream lines(table.csv());
  std::vector<bool> keep;
  std::string counts;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line + ",");
    std::size_t column = 0;
    const bool header = keep.empty();
    for (std::string cell; std::getline(cells, cell, ','); ++column) {
      if (header) keep.push_back(cell.size() < 3 || cell.substr(cell.size() - 3) != "_ms");
      if (keep.at(column)) counts += cell + ",";
    }
    counts += "\n";
  }
  return counts;
}

std::string countsOf(const ExperimentResult& result) {
  std::string counts;
  for (const auto& [suffix, table] : result.tables) counts += suffix + "\n" + countsOf(table);
  for (const Finding& finding : result.findings)
    if (!finding.is_duration) counts += finding.quantity + ": " + finding.here + "\n";
  return counts;
}

ExperimentResult runQuick(const std::string& name) {
  LaboratorySettings settings;
  settings.quick = true;
  return Laboratory(settings).run(name);
}

TEST(Table, IsWrittenAsCommaSeparatedText) {
  Table table({"name", "value"});
  table.add({"a, b", 0.5});
  table.add({"c", std::nan("")});
  EXPECT_EQ(table.csv(), "name,value\n\"a, b\",0.5\nc,\n");
  EXPECT_THROW(table.add({"only one"}), std::invalid_argument);
}

TEST(Laboratory, NamesItsExperimentsWhenAskedForAnother) {
  try {
    runQuick("potato");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("table_5_2"), std::string::npos);
  }
  LaboratorySettings settings;
  settings.data = "/nonexistent";
  EXPECT_THROW(Laboratory{settings}, std::runtime_error);
}

TEST(Laboratory, AnObjectIsPinnedDownWithLessSearchByEfficiency) {
  const ExperimentResult result = runQuick("fig_4_2");
  ASSERT_EQ(result.findings.size(), 2u);
  EXPECT_EQ(result.findings[1].verdict, Finding::Verdict::kAgrees) << result.findings[1].here;
  EXPECT_EQ(result.pictures.size(), 1u);
}

TEST(Laboratory, TheHistogramEndsWithTwoCandidates) {
  for (const Finding& finding : runQuick("fig_5_3").findings)
    EXPECT_EQ(finding.verdict, Finding::Verdict::kAgrees) << finding.quantity << finding.here;
}

TEST(Laboratory, ActiveMatchingSearchesLessThanJcbbAndASecondRunCountsTheSame) {
  const ExperimentResult result = runQuick("fig_5_10");
  ASSERT_FALSE(result.findings.empty());
  // "N of 6" cells; all in the thesis. Wide gates, which JCBB searches whole, cost little more than
  // small ones where they are searched coarse to fine.
  EXPECT_GE(std::stoi(result.findings.front().here), 4) << result.findings.front().here;
  EXPECT_EQ(countsOf(result), countsOf(runQuick("fig_5_10")));
}

TEST(WriteResult, WritesTablesPicturesAndFindings) {
  ExperimentResult result;
  Table table({"x"});
  table.add({1});
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("view", cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(0)));
  result.findings.push_back({"q", "t", "h", Finding::Verdict::kDiffers});
  const std::string folder = "/tmp/ams_result_" + std::to_string(getpid());
  std::filesystem::create_directories(folder);
  writeResult(folder, "e", result);
  EXPECT_TRUE(std::filesystem::exists(folder + "/e.csv"));
  EXPECT_TRUE(std::filesystem::exists(folder + "/e_view.png"));
  std::ifstream findings(folder + "/e.findings.csv");
  std::string header, row;
  std::getline(findings, header);
  std::getline(findings, row);
  EXPECT_EQ(row, "q,t,h,differs,0");
  std::filesystem::remove_all(folder);
  EXPECT_THROW(writeResult(folder, "e", result), std::runtime_error);
}

}  // namespace
}  // namespace active_matching_slam
