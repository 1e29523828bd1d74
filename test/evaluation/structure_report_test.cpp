#include "active_matching_slam/evaluation/structure_report.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "active_matching_slam/information/submap_color.h"

namespace active_matching_slam {
namespace {

/// Two pairs that share much, with weak links between; ids so that the pairs are interleaved.
MutualInformationGraph twoPairs() {
  MutualInformationGraph graph;
  graph.ids = {1, 2, 3, 4};
  graph.links = {{1, 2, 0.25, 3, false}, {1, 3, 4.0, 3, false}, {1, 4, 0.125, 3, false},
                 {2, 3, 0.5, 2, false},  {2, 4, 3.0, 1, false}, {3, 4, 0.125, 3, false}};
  return graph;
}

std::string contentOf(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::stringstream content;
  content << file.rdbuf();
  return content.str();
}

double brightness(const cv::Mat& picture, int x, int y) {
  const cv::Vec3b bgr = picture.at<cv::Vec3b>(y, x);
  return bgr[0] + bgr[1] + bgr[2];
}

TEST(StructureReport, TablesHoldEveryLinkFeatureAndLevel) {
  MutualInformationGraph graph = twoPairs();
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  EXPECT_EQ(mutualInformationCsv(graph),
            "first,second,information_bits,frames,in_tree\n"
            "1,2,0.25,3,0\n1,3,4,3,1\n1,4,0.125,3,0\n2,3,0.5,2,1\n2,4,3,1,1\n3,4,0.125,3,0\n");
  EXPECT_EQ(submapsCsv(hierarchy),
            "level,feature,submap\n"
            "0,1,0\n0,2,1\n0,3,2\n0,4,3\n1,1,0\n1,2,1\n1,3,0\n1,4,1\n2,1,0\n2,2,0\n2,3,0\n2,4,0\n");
  // Level 1 keeps 4, 3 and 0.5 of 8 bits; naive {1, 2} and {3, 4} keeps 0.25, 0.125 and 4.
  EXPECT_EQ(submapQualityCsv(hierarchy),
            "level,submaps,preserved_chow_liu,preserved_naive\n"
            "0,4,1,1\n1,2,0.9375,0.546875\n2,1,1,1\n");
}

TEST(StructureReport, PictureShowsWhatEachPartitionPreserves) {
  MutualInformationGraph graph = twoPairs();
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  const cv::Mat picture = informationMatrixPicture(graph, hierarchy, 1);
  ASSERT_EQ(picture.type(), CV_8UC3);
  // A panel is 480 px wide, a feature 120; order by submap: 1 3 2 4.
  const int left = 28, right = 28 + 536, upper = 98, lower = 98 + 542;
  const auto cell = [&](int x, int y, int column, int row) {
    return brightness(picture, x + 120 * column + 60, y + 120 * row + 60);
  };
  EXPECT_GT(cell(left, upper, 1, 0), cell(left, upper, 2, 1));  // 4 bits over 0.5
  EXPECT_GT(cell(left, upper, 2, 1), cell(left, upper, 3, 1));  // 0.5 over 0.125
  EXPECT_DOUBLE_EQ(cell(left, upper, 1, 0), cell(left, upper, 0, 1));
  EXPECT_DOUBLE_EQ(cell(right, upper, 1, 0), cell(left, upper, 1, 0));   // inside: preserved
  EXPECT_DOUBLE_EQ(cell(right, upper, 2, 1), cell(left, upper, 2, 1));   // strongest between
  EXPECT_DOUBLE_EQ(cell(right, upper, 3, 1), cell(right, upper, 0, 0));  // dropped: as no link
  EXPECT_GT(cell(right, lower, 2, 0), cell(right, lower, 1, 0));  // the cut link of 4 bits stays
  EXPECT_DOUBLE_EQ(cell(right, lower, 3, 1), cell(right, lower, 0, 0));  // that of 3 bits does not
}

TEST(StructureReport, PictureHasTheColoursThatTheSubmapsHaveEverywhere) {
  MutualInformationGraph graph = twoPairs();
  SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  for (int& label : hierarchy.levels[1].submap_of_feature) label += 7;
  const cv::Mat picture = informationMatrixPicture(graph, hierarchy, 1);
  for (int submap = 0; submap < 2; ++submap) {
    const cv::Vec3b bar = picture.at<cv::Vec3b>(98 + 240 * submap + 120, 28 - 8);
    const Eigen::Vector3f rgb = 255.0f * submapRgb(7 + submap);
    for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(rgb[channel], bar[2 - channel], 1.0);
  }
}

TEST(StructureReport, PictureOfNothingAndOfManyFeaturesIsDrawn) {
  MutualInformationGraph none;
  EXPECT_FALSE(informationMatrixPicture(none, buildSubmapHierarchy(none), 0).empty());
  MutualInformationGraph many;
  for (int i = 0; i < 600; ++i) {
    many.ids.push_back(i);
    if (i > 0) many.links.push_back({i - 1, i, 1.0 + i % 7, 1, false});
  }
  EXPECT_FALSE(informationMatrixPicture(many, buildSubmapHierarchy(many), 1).empty());
}

TEST(StructureReport, SaysWhatIsWrong) {
  MutualInformationGraph graph = twoPairs();
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  EXPECT_THROW(informationMatrixPicture(graph, hierarchy, 3), std::invalid_argument);
  EXPECT_THROW(informationMatrixPicture(graph, hierarchy, -1), std::invalid_argument);
  EXPECT_THROW(informationMatrixPicture({}, hierarchy, 0), std::invalid_argument);
  EXPECT_THROW(writeStructureReport("/no/such/directory", graph, hierarchy), std::runtime_error);
}

TEST(StructureReport, WritesTablesAndAPictureOfEachIntermediateLevel) {
  MutualInformationGraph graph = twoPairs();
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "ams_structure_report";
  std::filesystem::create_directories(folder);
  for (const char* level : {"2", "3"})  // of another map
    std::ofstream(folder / ("mutual_information_level_" + std::string(level) + ".png")) << "old";
  writeStructureReport(folder.string(), graph, hierarchy);
  EXPECT_EQ(contentOf(folder / "mutual_information.csv"), mutualInformationCsv(graph));
  EXPECT_EQ(contentOf(folder / "submaps.csv"), submapsCsv(hierarchy));
  EXPECT_EQ(contentOf(folder / "submap_quality.csv"), submapQualityCsv(hierarchy));
  EXPECT_TRUE(std::filesystem::exists(folder / "mutual_information_level_1.png"));
  EXPECT_FALSE(std::filesystem::exists(folder / "mutual_information_level_2.png"));
  EXPECT_FALSE(std::filesystem::exists(folder / "mutual_information_level_3.png"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace active_matching_slam
