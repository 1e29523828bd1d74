#include "active_matching_slam/evaluation/golden_vectors.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "golden_comparison.h"

namespace active_matching_slam {
namespace {

using namespace golden;

void checkGates(const YAML::Node& file, const Problem& problem, Comparison& compare) {
  PointListSearch search = problem.search();
  const MatchResult result = createMatcher("active_search")->match(problem.prior, search, {});
  std::vector<std::vector<int>> gates;
  std::vector<int> nearest(static_cast<std::size_t>(problem.prior.size()), -1);
  for (int f = 0; f < problem.prior.size(); ++f) {
    // Right after full gates everything found is in the gate.
    const SearchEllipse gate{problem.prior.mean(f), problem.prior.covariance(f)};
    gates.emplace_back();
    double nearest2 = 0.0;
    for (const SearchMatch& match : search.matches(f)) {
      gates.back().push_back(match.id);
      const double d2 = mahalanobisSquared(gate, match.pixel);
      int& best = nearest[static_cast<std::size_t>(f)];
      if (best < 0 || d2 < nearest2) best = match.id, nearest2 = d2;
    }
  }
  compare.section(file, "best_score", [&](const YAML::Node& expected) {
    compare.integers("best_score", expected, candidatePerFeature(search, result.match_of_feature));
  });
  compare.section(file, "nearest", [&](const YAML::Node& expected) {
    compare.integers("nearest", expected, nearest);
  });
  compare.section(file, "gate", [&](const YAML::Node& expected) {
    compare.integer("gate size", YAML::Node(expected.size()),
                    static_cast<std::int64_t>(gates.size()));
    for (std::size_t f = 0; f < std::min(gates.size(), expected.size()); ++f)
      compare.integers("gate[" + std::to_string(f) + "]", expected[f], gates[f]);
  });
}

void checkBaselines(const YAML::Node& file, const Problem& problem, Comparison& compare) {
  checkGates(file, problem, compare);
  MatchOptions options;
  options.jcbb_max_nodes = 0;
  compare.section(file, "jcbb", [&](const YAML::Node& expected) {
    PointListSearch search = problem.search();
    const MatchResult result = createMatcher("jcbb")->match(problem.prior, search, options);
    compare.integers("jcbb.assoc", expected["assoc"],
                     candidatePerFeature(search, result.match_of_feature));
    compare.integer("jcbb.pairings", expected["pairings"], result.statistics.matched);
    compare.number("jcbb.d2", expected["d2"], result.statistics.mahalanobis2, 0.0, kDistance);
    compare.integer("jcbb.pixels_total", expected["pixels_total"],
                    result.statistics.pixels_searched);
  });
  compare.section(file, "ransac1", [&](const YAML::Node& expected) {
    PointListSearch search = problem.search();
    const MatchResult result =
        createMatcher("one_point_ransac")->match(problem.prior, search, options);
    compare.integers("ransac1.assoc", expected["assoc"],
                     candidatePerFeature(search, result.match_of_feature));
    compare.integer("ransac1.inliers", expected["inliers"], result.statistics.inliers);
  });
}

}  // namespace

GoldenVectorReport checkGoldenVector(const std::string& path) {
  GoldenVectorReport report;
  report.name = std::filesystem::path(path).stem().string();
  Comparison compare(report);
  try {
    const YAML::Node file = YAML::LoadFile(path);
    if (!file.IsMap()) throw std::runtime_error("is no JSON object");
    if (!file["format"] || file["format"].as<std::string>("") != "1")
      throw std::runtime_error("format is not 1");
    const Problem problem = readProblem(file["input"]);
    checkInformation(file, problem.prior, compare);
    checkBaselines(file, problem, compare);
    checkTraces(file, problem, compare);
    if (report.compared == 0) compare.fail("holds nothing to compare");
  } catch (const std::exception& error) {
    compare.fail(error.what());
  }
  return report;
}

std::vector<std::string> goldenVectorsIn(const std::string& folder) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".json") paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace active_matching_slam
