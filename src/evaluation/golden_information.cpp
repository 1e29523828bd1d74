#include <algorithm>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/information/submap_hierarchy.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "golden_comparison.h"

namespace active_matching_slam::golden {
namespace {

std::string at(const std::string& what, std::size_t i) {
  return what + "[" + std::to_string(i) + "]";
}

void checkVector(const std::string& what, const YAML::Node& expected, const Eigen::VectorXd& actual,
                 double absolute, double relative, Comparison& compare) {
  compare.integer(what + " size", YAML::Node(expected.size()), actual.size());
  if (static_cast<Eigen::Index>(expected.size()) != actual.size()) return;
  for (std::size_t i = 0; i < expected.size(); ++i)
    compare.number(at(what, i), expected[i], actual(static_cast<Eigen::Index>(i)), absolute,
                   relative);
}

/// Pairs of a list, flattened in ascending order.
std::vector<int> flattened(std::vector<std::pair<int, int>> pairs) {
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> flat;
  for (const auto& [i, j] : pairs) flat.insert(flat.end(), {i, j});
  return flat;
}

void checkHierarchy(const YAML::Node& levels, const MeasurementPrior& prior, Comparison& compare) {
  MutualInformationGraph graph = informationGraph(prior.ids, prior.S);
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  compare.integer("mi.boruvka levels", YAML::Node(levels.size()),
                  static_cast<std::int64_t>(hierarchy.levels.size()));
  for (std::size_t l = 0; l < std::min(levels.size(), hierarchy.levels.size()); ++l) {
    const std::string what = at("mi.boruvka", l);
    const SubmapLevel& level = hierarchy.levels[l];
    compare.number(what + " preserved", levels[l]["preserved"], level.preserved_chow_liu, kBits);
    std::vector<std::vector<int>> clusters(static_cast<std::size_t>(level.submaps));
    for (std::size_t f = 0; f < level.submap_of_feature.size(); ++f)
      clusters[static_cast<std::size_t>(level.submap_of_feature[f])].push_back(static_cast<int>(f));
    std::sort(clusters.begin(), clusters.end());
    compare.integer(what + " clusters", YAML::Node(levels[l]["clusters"].size()), level.submaps);
    for (std::size_t c = 0; c < std::min(clusters.size(), levels[l]["clusters"].size()); ++c)
      compare.integers(at(what + " cluster", c), levels[l]["clusters"][c], clusters[c]);
    std::vector<std::pair<int, int>> wanted, links;
    for (const YAML::Node& link : levels[l]["links"])
      wanted.emplace_back(link[0].as<int>(), link[1].as<int>());
    for (const SubmapMerge& merge : hierarchy.merges)
      if (merge.level == static_cast<int>(l)) links.emplace_back(merge.first, merge.second);
    compare.integers(what + " links", YAML::Node(flattened(wanted)), flattened(links));
  }
}

void checkInformationOf(const YAML::Node& mi, const MeasurementPrior& prior, Comparison& compare) {
  const FeatureInformation information = featureInformation(prior.S);
  checkVector("mi.features", mi["features"], information.bits, kBits, 0.0, compare);
  checkVector("mi.L_det", mi["L_det"], information.precision_determinant, 0.0, kRelative, compare);
  const Eigen::MatrixXd pairwise = pairInformationMatrix(prior.S);
  for (int i = 0; i < prior.size(); ++i) {
    checkVector(at("mi.pairwise", static_cast<std::size_t>(i)), mi["pairwise"][i], pairwise.col(i),
                kBits, 0.0, compare);
    compare.number(at("mi.areas", static_cast<std::size_t>(i)), mi["areas"][i],
                   ellipseArea(prior.covariance(i)), 0.0, kRelative);
    compare.integer(at("mi.pixel_counts", static_cast<std::size_t>(i)), mi["pixel_counts"][i],
                    countEllipsePixels({prior.mean(i), prior.covariance(i)}, {}));
  }
  const ChowLiuTree tree = chowLiuTree(prior.S);
  std::vector<std::pair<int, int>> wanted, edges;
  for (const YAML::Node& edge : mi["tree_edges"])
    wanted.emplace_back(edge[0].as<int>(), edge[1].as<int>());
  for (const WeightedEdge& edge : tree.edges) edges.emplace_back(edge.first, edge.second);
  compare.integers("mi.tree_edges", YAML::Node(flattened(wanted)), flattened(edges));
  checkVector("mi.tree_mi", mi["tree_mi"], treeInformationBits(tree), kBits, 0.0, compare);
  compare.number("mi.tree_kl_bits", mi["tree_kl_bits"],
                 treeDivergenceBits(prior.S, tree).value_or(-1.0), kBits);
  checkHierarchy(mi["boruvka"], prior, compare);
}

}  // namespace

void checkInformation(const YAML::Node& file, const MeasurementPrior& prior, Comparison& compare) {
  compare.section(file, "mi",
                  [&](const YAML::Node& mi) { checkInformationOf(mi, prior, compare); });
}

}  // namespace active_matching_slam::golden
