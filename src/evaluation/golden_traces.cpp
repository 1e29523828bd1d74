#include <algorithm>

#include "active_matching_slam/matching/matcher.h"
#include "golden_comparison.h"

namespace active_matching_slam::golden {
namespace {

MatchOptions traceOptions(UpdateRule rule) {
  MatchOptions options;
  options.update_rule = rule;
  options.keep_trace = true;
  options.joint_rescoring = false;
  options.deferred_pruning_weight = 0.0;
  return options;
}

void checkWeights(const std::string& what, const YAML::Node& expected,
                  const std::vector<MatchStep::GaussianWeight>& actual, bool with_parent,
                  Comparison& compare) {
  compare.integer(what + " count", YAML::Node(expected.size()),
                  static_cast<std::int64_t>(actual.size()));
  for (std::size_t k = 0; k < std::min(expected.size(), actual.size()); ++k) {
    const YAML::Node entry = expected[k];
    const std::string of = what + "[" + std::to_string(k) + "]";
    compare.integer(of + " id", entry[0], actual[k].gaussian);
    if (with_parent) compare.integer(of + " parent", entry[1], actual[k].parent);
    const YAML::Node weight = entry[with_parent ? 2 : 1];
    if (weight.as<double>() >= kLeastWeight) compare.number(of, weight, actual[k].weight, kWeight);
  }
}

void checkStep(const std::string& what, const YAML::Node& expected, const MatchStep& step,
               const PointListSearch& search, Comparison& compare) {
  compare.integer(what + " feature", expected["feature"], step.feature);
  compare.integer(what + " gaussian", expected["gaussian"], step.gaussian);
  compare.number(what + " i_discrete", expected["i_discrete"], step.discrete_information_bits,
                 kBits);
  compare.number(what + " i_continuous", expected["i_continuous"], step.continuous_information_bits,
                 kBits);
  compare.number(what + " area", expected["area"], step.area_px, 0.0, kRelative);
  compare.number(what + " score", expected["score"], step.score, kBits / step.area_px, kBits);
  compare.number(what + " mi", expected["mi"], step.mutual_information_bits, kBits);
  compare.number(what + " p_null", expected["p_null"], step.null_probability, kBits);
  compare.integer(what + " pixels_in_ellipse", expected["pixels_in_ellipse"],
                  step.pixels_in_ellipse);
  compare.integer(what + " pixels_new", expected["pixels_new"], step.pixels_new);
  compare.integers(what + " matches", expected["matches"],
                   candidatesOf(search, step.feature, step.matches));
  if (expected["spawned"])
    compare.integers(what + " spawned", expected["spawned"],
                     candidatesOf(search, step.feature, step.spawned));
  checkWeights(what + " weights", expected["weights"], step.weights, true, compare);
  checkWeights(what + " pruned", expected["pruned"], step.pruned, false, compare);
}

void checkTrace(const std::string& what, const YAML::Node& expected, const std::string& matcher,
                UpdateRule rule, const Problem& problem, Comparison& compare) {
  PointListSearch search = problem.search();
  const MatchResult result =
      createMatcher(matcher)->match(problem.prior, search, traceOptions(rule));
  const std::size_t before = compare.differences();
  compare.integer(what + " steps", YAML::Node(expected["steps"].size()),
                  static_cast<std::int64_t>(result.trace.size()));
  for (std::size_t i = 0; i < std::min(result.trace.size(), expected["steps"].size()); ++i) {
    checkStep(what + " step " + std::to_string(i), expected["steps"][i], result.trace[i], search,
              compare);
    if (compare.differences() > before) return;  // what follows differs for that reason
  }
  compare.integers(what + " assoc", expected["assoc"],
                   candidatePerFeature(search, result.match_of_feature));
  compare.number(what + " weight", expected["weight"], result.statistics.accepted_weight, kWeight);
  compare.integer(what + " gaussian", expected["gaussian"], result.hypotheses.front().gaussian);
  for (int f = 0; f < problem.prior.size(); ++f)
    compare.integer(what + " pixels[" + std::to_string(f) + "]", expected["pixels"][f],
                    search.searchedPixels(f).size());
  compare.integer(what + " pixels_total", expected["pixels_total"],
                  result.statistics.pixels_searched);
  compare.integer(what + " max_gaussians", expected["max_gaussians"],
                  result.statistics.max_gaussians);
  compare.integer(what + " encountered", expected["encountered"], result.statistics.matches_met);
  compare.integer(what + " mixture", YAML::Node(expected["mixture"].size()),
                  static_cast<std::int64_t>(result.hypotheses.size()));
  for (const YAML::Node& survivor : expected["mixture"]) {
    const int id = survivor["id"].as<int>();
    const auto h = std::find_if(result.hypotheses.begin(), result.hypotheses.end(),
                                [&](const MatchHypothesis& k) { return k.gaussian == id; });
    const std::string of = what + " survivor " + std::to_string(id);
    if (h == result.hypotheses.end()) {
      compare.fail(of + " is missing");
      continue;
    }
    compare.integer(of + " parent", survivor["parent"], h->parent);
    compare.number(of + " weight", survivor["weight"], h->probability, kWeight);
    compare.integers(of + " assoc", survivor["assoc"],
                     candidatePerFeature(search, h->match_of_feature));
  }
}

/// Rule thesis with the stop rule that a heavy Gaussian without candidates ends the search.
void checkFinish(const YAML::Node& expected, const Problem& problem, Comparison& compare) {
  PointListSearch search = problem.search();
  MatchOptions options = traceOptions(UpdateRule::kThesis);
  options.finish_weight = 0.9;
  const MatchResult result = createMatcher("active")->match(problem.prior, search, options);
  compare.integers("am_finish assoc", expected["assoc"],
                   candidatePerFeature(search, result.match_of_feature));
  compare.number("am_finish weight", expected["weight"], result.statistics.accepted_weight,
                 kWeight);
  compare.integer("am_finish n_steps", expected["n_steps"],
                  static_cast<std::int64_t>(result.trace.size()));
  compare.integer("am_finish pixels_total", expected["pixels_total"],
                  result.statistics.pixels_searched);
}

void checkFirstStep(const YAML::Node& expected, const Problem& problem, Comparison& compare) {
  PointListSearch search = problem.search();
  MatchOptions options = traceOptions(UpdateRule::kThesis);
  options.max_pixels = 1;  // a budget that one search uses up
  const MatchResult result = createMatcher("active")->match(problem.prior, search, options);
  if (result.trace.size() != 1) return compare.fail("am_step0: no single step");
  compare.number("am_step0 p_null", expected["p_null"], result.trace[0].null_probability, kBits);
}

}  // namespace

void checkTraces(const YAML::Node& file, const Problem& problem, Comparison& compare) {
  const auto trace = [&](const std::string& name, const std::string& matcher, UpdateRule rule) {
    compare.section(file, name, [&](const YAML::Node& expected) {
      checkTrace(name, expected, matcher, rule, problem, compare);
    });
  };
  compare.section(file, "am_step0",
                  [&](const YAML::Node& expected) { checkFirstStep(expected, problem, compare); });
  trace("am", "active", UpdateRule::kThesis);
  trace("clam", "chow_liu", UpdateRule::kThesis);
  trace("am_incremental", "active", UpdateRule::kIncremental);
  trace("clam_incremental", "chow_liu", UpdateRule::kIncremental);
  compare.section(file, "am_finish",
                  [&](const YAML::Node& expected) { checkFinish(expected, problem, compare); });
}

}  // namespace active_matching_slam::golden
