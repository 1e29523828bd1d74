#include "active_matching_slam/information/submap_hierarchy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>

#include "active_matching_slam/information/gaussian_information.h"
#include "information/random_graph.h"
#include "information/vectors.h"

namespace active_matching_slam {
namespace {

using test::randomGraph;

/// Table 6.1 as its text says it: inside clusters all, between two clusters the strongest.
double plainPreserved(const MutualInformationGraph& graph, const std::vector<int>& labels) {
  double total = 0.0, kept = 0.0;
  std::map<std::set<int>, double> strongest;
  for (const InformationLink& link : graph.links) {
    const auto at = [&](std::int64_t id) {
      return labels[std::find(graph.ids.begin(), graph.ids.end(), id) - graph.ids.begin()];
    };
    total += link.information_bits;
    if (at(link.first) == at(link.second)) {
      kept += link.information_bits;
    } else {
      double& best = strongest[{at(link.first), at(link.second)}];
      best = std::max(best, link.information_bits);
    }
  }
  for (const auto& pair : strongest) kept += pair.second;
  return total > 0.0 ? kept / total : 1.0;
}

TEST(SubmapHierarchy, EveryLevelIsThePlainFormula) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const double density = seed % 3 == 0 ? 1.0 : (seed % 3 == 1 ? 0.3 : 0.03);
    MutualInformationGraph graph = randomGraph(seed, seed, density, seed % 2 ? 2 : 1000000);
    const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
    EXPECT_EQ(hierarchy.ids, graph.ids);
    ASSERT_GE(hierarchy.levels.size(), 1u);
    EXPECT_EQ(hierarchy.levels[0].submaps, static_cast<int>(seed));
    for (const SubmapLevel& level : hierarchy.levels) {
      const std::set<int> labels(level.submap_of_feature.begin(), level.submap_of_feature.end());
      EXPECT_EQ(static_cast<int>(labels.size()), level.submaps);
      if (seed == 0) continue;
      EXPECT_NEAR(level.preserved_chow_liu, plainPreserved(graph, level.submap_of_feature), 1e-12);
      EXPECT_NEAR(level.preserved_naive, plainPreserved(graph, naivePartition(seed, level.submaps)),
                  1e-12);
    }
  }
}

TEST(SubmapHierarchy, MergesAreTheMarkedTreeAndLeadFromLevelToLevel) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    MutualInformationGraph graph = randomGraph(23, seed, seed % 2 ? 1.0 : 0.08);
    const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
    MutualInformationGraph marked = graph;
    markTree(marked);
    std::set<std::pair<std::int64_t, std::int64_t>> tree, merges;
    for (std::size_t e = 0; e < graph.links.size(); ++e) {
      EXPECT_EQ(graph.links[e].in_tree, marked.links[e].in_tree);
      if (graph.links[e].in_tree) tree.insert({graph.links[e].first, graph.links[e].second});
    }
    std::vector<int> labels(23);
    std::iota(labels.begin(), labels.end(), 0);
    std::size_t m = 0;
    for (std::size_t h = 0; h < hierarchy.levels.size(); ++h) {
      for (; m < hierarchy.merges.size() && hierarchy.merges[m].level <= static_cast<int>(h); ++m) {
        const SubmapMerge& merge = hierarchy.merges[m];
        merges.insert({graph.ids[merge.first], graph.ids[merge.second]});
        EXPECT_NE(labels[merge.first], labels[merge.second]);
        std::replace(labels.begin(), labels.end(), int{labels[merge.second]},
                     int{labels[merge.first]});
      }
      for (int i = 0; i < 23; ++i) {
        for (int k = 0; k < i; ++k) {
          EXPECT_EQ(labels[i] == labels[k], hierarchy.levels[h].submap_of_feature[i] ==
                                                hierarchy.levels[h].submap_of_feature[k]);
        }
      }
    }
    EXPECT_EQ(m, hierarchy.merges.size());
    EXPECT_EQ(merges, tree);
  }
}

TEST(SubmapHierarchy, AtLeastHalvesTheClustersThatHaveALink) {
  MutualInformationGraph graph = randomGraph(100, 4);
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  for (std::size_t h = 1; h < hierarchy.levels.size(); ++h) {
    EXPECT_LE(2 * hierarchy.levels[h].submaps, hierarchy.levels[h - 1].submaps);
  }
  EXPECT_EQ(hierarchy.levels.back().submaps, 1);
}

TEST(SubmapHierarchy, NothingOneFeatureAndNoLinksHaveLevelZeroOnly) {
  for (int features : {0, 1, 4}) {
    MutualInformationGraph graph = randomGraph(features, 0, 0.0);
    const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
    ASSERT_EQ(hierarchy.levels.size(), 1u);
    EXPECT_EQ(hierarchy.levels[0].submaps, features);
    EXPECT_DOUBLE_EQ(hierarchy.levels[0].preserved_chow_liu, 1.0);
    EXPECT_TRUE(hierarchy.merges.empty());
  }
}

TEST(SubmapHierarchy, LinksOfZeroBitsJoinNothing) {
  MutualInformationGraph graph;
  graph.ids = {1, 2, 3};
  graph.links = {{1, 2, 0.0, 5, true}, {2, 3, 1.0, 5, false}};
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  EXPECT_FALSE(graph.links[0].in_tree);
  EXPECT_TRUE(graph.links[1].in_tree);
  EXPECT_EQ(hierarchy.levels.back().submap_of_feature, (std::vector<int>{0, 1, 1}));
}

TEST(SubmapHierarchy, ADisconnectedGraphEndsInAForest) {
  MutualInformationGraph graph;
  graph.ids = {1, 2, 3, 4, 5};
  graph.links = {{1, 4, 1.0, 1, false}, {2, 5, 2.0, 1, false}};
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  ASSERT_EQ(hierarchy.levels.size(), 2u);
  EXPECT_EQ(hierarchy.levels[1].submaps, 3);
  EXPECT_EQ(hierarchy.levels[1].submap_of_feature, (std::vector<int>{0, 1, 2, 0, 1}));
  EXPECT_DOUBLE_EQ(hierarchy.levels[1].preserved_chow_liu, 1.0);
}

TEST(SubmapHierarchy, EqualLinksEverywhereGiveOneStar) {
  MutualInformationGraph graph = randomGraph(6, 0, 1.0, 1);
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  ASSERT_EQ(hierarchy.levels.size(), 2u);
  for (const SubmapMerge& merge : hierarchy.merges) EXPECT_EQ(merge.first, 0);
}

TEST(SubmapHierarchy, NaivePartitionIsEqualSizesInOrder) {
  EXPECT_EQ(naivePartition(6, 2), (std::vector<int>{0, 0, 0, 1, 1, 1}));
  for (int features = 1; features < 30; ++features) {
    for (int clusters = 1; clusters <= features; ++clusters) {
      const std::vector<int> labels = naivePartition(features, clusters);
      EXPECT_TRUE(std::is_sorted(labels.begin(), labels.end()));
      for (int c = 0; c < clusters; ++c) {
        const auto size = std::count(labels.begin(), labels.end(), c);
        EXPECT_GE(size, features / clusters);
        EXPECT_LE(size, (features + clusters - 1) / clusters);
      }
    }
  }
}

TEST(SubmapHierarchy, PreservedInformationChecksItsLabels) {
  EXPECT_THROW(preservedInformation({}, {0, 2}, 2), std::invalid_argument);
  EXPECT_THROW(preservedInformation({}, {0, -1}, 2), std::invalid_argument);
  EXPECT_DOUBLE_EQ(preservedInformation({}, {0, 1}, 2), 1.0);
}

TEST(SubmapHierarchy, PreservedInformationOfFewLinksAndManyClustersIsThePlainFormula) {
  MutualInformationGraph graph = randomGraph(60, 3, 0.1);
  const std::vector<int> labels = naivePartition(60, 40);
  EXPECT_NEAR(preservedInformation(graphEdges(graph), labels, 40), plainPreserved(graph, labels),
              1e-12);
}

TEST(SubmapHierarchy, PreservedLinksAreWhatIsPreserved) {
  for (int clusters : {1, 2, 5, 30}) {
    const MutualInformationGraph graph = randomGraph(30, clusters, 0.7, clusters == 2 ? 3 : 1000);
    const std::vector<WeightedEdge> edges = graphEdges(graph);
    const std::vector<int> labels = naivePartition(30, clusters);
    const std::vector<char> kept = preservedLinks(edges, labels, clusters);
    double total = 0.0, sum = 0.0;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      total += edges[e].weight;
      if (kept[e]) sum += edges[e].weight;
    }
    EXPECT_NEAR(sum / total, preservedInformation(edges, labels, clusters), 1e-12);
  }
  EXPECT_THROW(preservedLinks({}, {1}, 1), std::invalid_argument);
}

TEST(SubmapHierarchy, AgreesWithTheGoldenVectors) {
  const std::vector<std::string> files = test::vectorFiles();
  if (files.empty()) GTEST_SKIP() << "no vectors beside AMS_DATA";
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const nlohmann::json vector = test::readJson(file);
    const Eigen::MatrixXd S = test::matrixOf(vector["input"]["S"]);
    std::vector<std::int64_t> ids(S.rows() / 2);
    std::iota(ids.begin(), ids.end(), 0);
    MutualInformationGraph graph = informationGraph(ids, S);
    const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
    const nlohmann::json& levels = vector["mi"]["boruvka"];
    ASSERT_EQ(hierarchy.levels.size(), levels.size());
    for (std::size_t h = 0; h < levels.size(); ++h) {
      const SubmapLevel& level = hierarchy.levels[h];
      std::vector<std::vector<int>> clusters(level.submaps), links;
      for (std::size_t i = 0; i < ids.size(); ++i) {
        clusters[level.submap_of_feature[i]].push_back(static_cast<int>(i));
      }
      for (const SubmapMerge& merge : hierarchy.merges) {
        if (merge.level == static_cast<int>(h)) links.push_back({merge.first, merge.second});
      }
      std::sort(links.begin(), links.end());
      EXPECT_EQ(clusters, levels[h]["clusters"].get<std::vector<std::vector<int>>>());
      EXPECT_EQ(links, levels[h]["links"].get<std::vector<std::vector<int>>>());
      EXPECT_NEAR(level.preserved_chow_liu, levels[h]["preserved"].get<double>(), 1e-9);
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
