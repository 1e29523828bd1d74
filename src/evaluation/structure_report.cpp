#include "active_matching_slam/evaluation/structure_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "active_matching_slam/evaluation/plot_canvas.h"
#include "active_matching_slam/evaluation/text_file.h"
#include "active_matching_slam/information/submap_color.h"

namespace active_matching_slam {
namespace {

constexpr int kPanel = 480, kMargin = 28, kHeading = 64, kTitle = 34, kBar = 90;

/// Clusters numbered 0, 1, ... by lowest id, whatever labels they carry.
std::vector<int> compactLabels(const std::vector<int>& labels) {
  std::vector<int> seen, compact;
  for (int label : labels) {
    const auto at = std::find(seen.begin(), seen.end(), label);
    compact.push_back(static_cast<int>(at - seen.begin()));
    if (at == seen.end()) seen.push_back(label);
  }
  return compact;
}

/// Features by cluster, and clusters that join at higher levels beside each other.
std::vector<int> orderByCluster(const SubmapHierarchy& hierarchy, int level) {
  std::vector<std::vector<int>> labels;  // coarsest level first
  for (int h = static_cast<int>(hierarchy.levels.size()) - 1; h >= level; --h) {
    labels.push_back(compactLabels(hierarchy.levels[h].submap_of_feature));
  }
  std::vector<int> order(hierarchy.ids.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    for (const std::vector<int>& of_level : labels) {
      if (of_level[a] != of_level[b]) return of_level[a] < of_level[b];
    }
    return false;
  });
  return order;
}

/// Inverse of `order`: the row of each feature.
std::vector<int> rowsOf(const std::vector<int>& order) {
  std::vector<int> rows(order.size());
  for (std::size_t r = 0; r < order.size(); ++r) rows[order[r]] = static_cast<int>(r);
  return rows;
}

cv::Scalar submapColour(int submap) {
  const Eigen::Vector3f rgb = 255.0f * submapRgb(submap);
  return {rgb[2], rgb[1], rgb[0]};
}

/// Bits to colours; the root lifts weak links out of the dark.
cv::Mat coloured(const cv::Mat& bits, double brightest_bits) {
  cv::Mat scaled(bits.size(), CV_8UC1);
  for (int r = 0; r < bits.rows; ++r) {
    for (int c = 0; c < bits.cols; ++c) {
      const double fraction = brightest_bits > 0.0 ? bits.at<double>(r, c) / brightest_bits : 0.0;
      scaled.at<uchar>(r, c) = cv::saturate_cast<uchar>(255.0 * std::sqrt(std::min(1.0, fraction)));
    }
  }
  cv::Mat picture;
  cv::applyColorMap(scaled, picture, cv::COLORMAP_INFERNO);
  return picture;
}

struct Panel {
  std::vector<int> order;     ///< features from left to right and top to bottom
  std::vector<int> clusters;  ///< label of each feature, which is a colour too
  std::vector<char> links;    ///< per edge, which are shown
  std::string title;
};

void drawPanel(cv::Mat& picture, cv::Point corner, const std::vector<WeightedEdge>& edges,
               double brightest_bits, const Panel& panel) {
  const int features = static_cast<int>(panel.order.size());
  const std::vector<int> rows = rowsOf(panel.order);
  cv::Mat bits = cv::Mat::zeros(features, features, CV_64F);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (!panel.links[e]) continue;
    const int a = rows[edges[e].first], b = rows[edges[e].second];
    bits.at<double>(a, b) = bits.at<double>(b, a) = edges[e].weight;
  }
  const cv::Rect place(corner.x, corner.y, kPanel, kPanel);
  cv::resize(coloured(bits, brightest_bits), picture(place), place.size(), 0, 0,
             features > kPanel ? cv::INTER_AREA : cv::INTER_NEAREST);
  for (int begin = 0; begin < features;) {
    const int cluster = panel.clusters[panel.order[begin]];
    int end = begin;
    while (end < features && panel.clusters[panel.order[end]] == cluster) ++end;
    const int from = begin * kPanel / features, to = end * kPanel / features;
    const cv::Scalar colour = submapColour(cluster);
    cv::rectangle(picture, cv::Point(corner.x + from, corner.y + from),
                  cv::Point(corner.x + to - 1, corner.y + to - 1), colour, 1);
    cv::rectangle(picture, cv::Point(corner.x - 12, corner.y + from),
                  cv::Point(corner.x - 5, corner.y + to - 1), colour, cv::FILLED);
    begin = end;
  }
  putPlotText(&picture, panel.title, {corner.x, corner.y - 10}, 0.5);
}

void drawBitsBar(cv::Mat& picture, cv::Rect place, double brightest_bits) {
  cv::Mat bits(place.height, 1, CV_64F);
  for (int r = 0; r < place.height; ++r) {
    bits.at<double>(r, 0) = brightest_bits * (place.height - 1 - r) / (place.height - 1);
  }
  cv::resize(coloured(bits, brightest_bits), picture(place), place.size(), 0, 0, cv::INTER_NEAREST);
  for (int k = 0; k <= 4; ++k) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.2g", brightest_bits * (4 - k) / 4.0);
    putPlotText(&picture, text, {place.x + place.width + 6, place.y + k * place.height / 4 + 5},
                0.42);
  }
  putPlotText(&picture, "bits", {place.x, place.y - 10}, 0.5);
}

std::string percent(const char* name, double fraction) {
  char text[96];
  std::snprintf(text, sizeof(text), "%s preserves %.1f %%", name, 100.0 * fraction);
  return text;
}

}  // namespace

std::string mutualInformationCsv(const MutualInformationGraph& graph) {
  std::string csv = "first,second,information_bits,frames,in_tree\n";
  for (const InformationLink& link : graph.links) {
    csv += std::to_string(link.first) + "," + std::to_string(link.second) + "," +
           numberText(link.information_bits) + "," + std::to_string(link.frames) + "," +
           (link.in_tree ? "1" : "0") + "\n";
  }
  return csv;
}

std::string submapsCsv(const SubmapHierarchy& hierarchy) {
  std::string csv = "level,feature,submap\n";
  for (std::size_t h = 0; h < hierarchy.levels.size(); ++h) {
    for (std::size_t i = 0; i < hierarchy.ids.size(); ++i) {
      csv += std::to_string(h) + "," + std::to_string(hierarchy.ids[i]) + "," +
             std::to_string(hierarchy.levels[h].submap_of_feature[i]) + "\n";
    }
  }
  if (hierarchy.requested.submaps > 0)
    for (std::size_t i = 0; i < hierarchy.ids.size(); ++i)
      csv += "requested," + std::to_string(hierarchy.ids[i]) + "," +
             std::to_string(hierarchy.requested.submap_of_feature[i]) + "\n";
  return csv;
}

std::string submapQualityCsv(const SubmapHierarchy& hierarchy) {
  std::string csv = "level,submaps,preserved_chow_liu,preserved_naive\n";
  const auto row = [&csv](const std::string& name, const SubmapLevel& level) {
    csv += name + "," + std::to_string(level.submaps) + "," + numberText(level.preserved_chow_liu) +
           "," + numberText(level.preserved_naive) + "\n";
  };
  for (std::size_t h = 0; h < hierarchy.levels.size(); ++h)
    row(std::to_string(h), hierarchy.levels[h]);
  if (hierarchy.requested.submaps > 0) row("requested", hierarchy.requested);
  return csv;
}

cv::Mat informationMatrixPicture(const MutualInformationGraph& graph,
                                 const SubmapHierarchy& hierarchy, int level) {
  if (level < 0 || level >= static_cast<int>(hierarchy.levels.size())) {
    throw std::invalid_argument("level is " + std::to_string(level) + ", allowed: 0 to " +
                                std::to_string(static_cast<int>(hierarchy.levels.size()) - 1));
  }
  if (graph.ids != hierarchy.ids) {
    throw std::invalid_argument("graph has other features than the hierarchy");
  }
  const SubmapLevel& chosen = hierarchy.levels[level];
  const int features = static_cast<int>(graph.ids.size());
  const std::vector<WeightedEdge> edges = graphEdges(graph);
  double brightest_bits = 0.0;
  for (const WeightedEdge& edge : edges) brightest_bits = std::max(brightest_bits, edge.weight);
  const std::vector<char> all(edges.size(), 1);
  const std::vector<int> submaps = compactLabels(chosen.submap_of_feature);
  const std::vector<int> naive = naivePartition(features, chosen.submaps);
  const std::vector<int> by_submap = orderByCluster(hierarchy, level);
  std::vector<int> by_id(features);
  std::iota(by_id.begin(), by_id.end(), 0);

  const int step_x = kPanel + 2 * kMargin, step_y = kPanel + kTitle + kMargin;
  cv::Mat picture(kHeading + 2 * step_y, 2 * step_x + kBar, CV_8UC3, cv::Scalar::all(255));
  char heading[96];
  std::snprintf(heading, sizeof(heading), "Mutual information of %d features, level %d: %d submaps",
                features, level, chosen.submaps);
  putPlotText(&picture, heading, {kMargin, 32}, 0.7);
  const std::vector<int>& labels = chosen.submap_of_feature;
  const Panel panels[2][2] = {
      {{by_submap, labels, all, "all links, features ordered by submap"},
       {by_submap, labels, preservedLinks(edges, submaps, chosen.submaps),
        percent("Chow-Liu", chosen.preserved_chow_liu)}},
      {{by_id, naive, all, "all links, features in order of initialisation"},
       {by_id, naive, preservedLinks(edges, naive, chosen.submaps),
        percent("naive", chosen.preserved_naive)}}};
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      const cv::Point corner(kMargin + column * step_x, kHeading + kTitle + row * step_y);
      if (features > 0) drawPanel(picture, corner, edges, brightest_bits, panels[row][column]);
    }
  }
  drawBitsBar(picture, {2 * step_x, kHeading + kTitle, 18, kPanel}, brightest_bits);
  return picture;
}

void writeStructureReport(const std::string& directory, const MutualInformationGraph& graph,
                          const SubmapHierarchy& hierarchy) {
  writeTextFile(directory + "/mutual_information.csv", mutualInformationCsv(graph));
  writeTextFile(directory + "/submaps.csv", submapsCsv(hierarchy));
  writeTextFile(directory + "/submap_quality.csv", submapQualityCsv(hierarchy));
  const auto pathOf = [&directory](int level) {
    return directory + "/mutual_information_level_" + std::to_string(level) + ".png";
  };
  const int levels = static_cast<int>(hierarchy.levels.size());
  // Those of a map before, which may have had more levels, go first.
  for (int level = 1; std::filesystem::remove(pathOf(level)) || level < levels; ++level) {
    if (level >= levels || hierarchy.levels[level].submaps < 2) continue;
    if (!cv::imwrite(pathOf(level), informationMatrixPicture(graph, hierarchy, level)))
      throw std::runtime_error(pathOf(level) + ": cannot be written");
  }
}

}  // namespace active_matching_slam
