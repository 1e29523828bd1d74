#include "active_matching_slam/evaluation/structure_report.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

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

/// Where the matrices are, those of the upper row first, from left to right: large areas that are
/// not white.
std::vector<cv::Rect> panelsOf(const cv::Mat& picture) {
  cv::Mat grey, marked, labels, stats, centres;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  cv::threshold(grey, marked, 250.0, 255.0, cv::THRESH_BINARY_INV);
  const int areas = cv::connectedComponentsWithStats(marked, labels, stats, centres);
  std::vector<cv::Rect> panels;
  for (int i = 1; i < areas; ++i) {
    const cv::Rect place(stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                         stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT));
    if (place.width > picture.cols / 4 && place.height > picture.rows / 4) panels.push_back(place);
  }
  std::sort(panels.begin(), panels.end(), [](const cv::Rect& a, const cv::Rect& b) {
    return std::make_pair(a.y, a.x) < std::make_pair(b.y, b.x);
  });
  return panels;
}

/// How many have the colour of a submap.
int pixelsOf(int submap, const cv::Mat& picture) {
  const Eigen::Vector3f rgb = 255.0f * submapRgb(submap);
  const cv::Scalar bgr(rgb[2], rgb[1], rgb[0]);
  cv::Mat found;
  cv::inRange(picture, bgr - cv::Scalar::all(1.0), bgr + cv::Scalar::all(1.0), found);
  return cv::countNonZero(found);
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
  const std::vector<cv::Rect> panels = panelsOf(picture);
  ASSERT_EQ(panels.size(), 4u);
  // Of a matrix of four features; order by submap: 1 3 2 4.
  const auto cell = [&](int panel, int column, int row) {
    const cv::Rect& place = panels[panel];
    return brightness(picture, place.x + (2 * column + 1) * place.width / 8,
                      place.y + (2 * row + 1) * place.height / 8);
  };
  enum { kAll, kPreserved, kAllById, kNaive };
  EXPECT_GT(cell(kAll, 1, 0), cell(kAll, 2, 1));  // 4 bits over 0.5
  EXPECT_GT(cell(kAll, 2, 1), cell(kAll, 3, 1));  // 0.5 over 0.125
  EXPECT_DOUBLE_EQ(cell(kAll, 1, 0), cell(kAll, 0, 1));
  EXPECT_DOUBLE_EQ(cell(kPreserved, 1, 0), cell(kAll, 1, 0));        // inside: preserved
  EXPECT_DOUBLE_EQ(cell(kPreserved, 2, 1), cell(kAll, 2, 1));        // strongest between
  EXPECT_DOUBLE_EQ(cell(kPreserved, 3, 1), cell(kPreserved, 0, 0));  // dropped: as no link
  EXPECT_GT(cell(kNaive, 2, 0), cell(kNaive, 1, 0));                 // the cut link of 4 bits stays
  EXPECT_DOUBLE_EQ(cell(kNaive, 3, 1), cell(kNaive, 0, 0));          // that of 3 bits does not
}

TEST(StructureReport, PictureHasTheColoursThatTheSubmapsHaveEverywhere) {
  MutualInformationGraph graph = twoPairs();
  SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  const cv::Mat plain = informationMatrixPicture(graph, hierarchy, 1);
  for (int& label : hierarchy.levels[1].submap_of_feature) label += 7;
  const cv::Mat picture = informationMatrixPicture(graph, hierarchy, 1);
  for (int submap = 7; submap < 9; ++submap) {
    EXPECT_EQ(pixelsOf(submap, plain), 0) << submap;
    EXPECT_GT(pixelsOf(submap, picture), 0) << submap;
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
