#include "active_matching_slam/matching/golden_vectors.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "golden_comparison.h"

namespace active_matching_slam {
namespace {

using namespace golden;

void checkBaselines(const YAML::Node& file, const Problem& problem, Comparison& compare) {
  MatchOptions options;
  options.jcbb_max_nodes = 0;
  PointListSearch search = problem.search();
  MatchResult result = createMatcher("active_search")->match(problem.prior, search, options);
  compare.integers("best_score", file["best_score"],
                   candidatePerFeature(search, result.match_of_feature));
  for (int f = 0; f < problem.prior.size(); ++f) {
    // Right after full gates everything found is in the gate.
    const SearchEllipse gate{problem.prior.mean(f), problem.prior.covariance(f)};
    std::vector<int> found;
    int nearest = -1;
    double nearest2 = 0.0;
    for (const SearchMatch& match : search.matches(f)) {
      found.push_back(match.id);
      const double d2 = mahalanobisSquared(gate, match.pixel);
      if (nearest < 0 || d2 < nearest2) nearest = match.id, nearest2 = d2;
    }
    const std::string of = "[" + std::to_string(f) + "]";
    compare.integers("gate" + of, file["gate"][f], found);
    compare.integer("nearest" + of, file["nearest"][f], nearest);
  }
  search.reset();
  result = createMatcher("jcbb")->match(problem.prior, search, options);
  const YAML::Node jcbb = file["jcbb"];
  compare.integers("jcbb.assoc", jcbb["assoc"],
                   candidatePerFeature(search, result.match_of_feature));
  compare.integer("jcbb.pairings", jcbb["pairings"], result.statistics.matched);
  compare.number("jcbb.d2", jcbb["d2"], result.statistics.mahalanobis2, 0.0, kDistance);
  compare.integer("jcbb.pixels_total", jcbb["pixels_total"], result.statistics.pixels_searched);
  search.reset();
  result = createMatcher("one_point_ransac")->match(problem.prior, search, options);
  compare.integers("ransac1.assoc", file["ransac1"]["assoc"],
                   candidatePerFeature(search, result.match_of_feature));
  compare.integer("ransac1.inliers", file["ransac1"]["inliers"], result.statistics.inliers);
}

}  // namespace

GoldenVectorReport checkGoldenVector(const std::string& path) {
  GoldenVectorReport report;
  report.name = std::filesystem::path(path).stem().string();
  Comparison compare(report);
  try {
    const YAML::Node file = YAML::LoadFile(path);
    if (file["format"].as<int>() != 1) throw std::runtime_error("format is not 1");
    const Problem problem = readProblem(file["input"]);
    checkInformation(file["mi"], problem.prior, compare);
    checkBaselines(file, problem, compare);
    checkTraces(file, problem, compare);
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
