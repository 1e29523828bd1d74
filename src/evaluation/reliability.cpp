#include "active_matching_slam/evaluation/reliability.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

/// By feature, the ellipses that the accepted hypothesis and its ancestors searched.
std::vector<std::vector<SearchEllipse>> ancestryOf(const MatchResult& result) {
  std::map<int, std::size_t> birth;  // of a Gaussian: the step that made it
  std::map<int, int> parent;
  for (std::size_t step = 0; step < result.trace.size(); ++step)
    for (const auto& entry : result.trace[step].weights) {
      if (entry.gaussian > 0) birth.emplace(entry.gaussian, step);
      parent[entry.gaussian] = entry.parent;
    }
  const MatchHypothesis& accepted = result.hypotheses.front();
  std::vector<std::vector<SearchEllipse>> ancestry(accepted.match_of_feature.size());
  std::size_t until = result.trace.size();
  for (int id = accepted.gaussian; id >= 0; id = parent[id]) {
    for (std::size_t step = 0; step < until; ++step)
      if (result.trace[step].gaussian == id)
        ancestry[slot(result.trace[step].feature)].push_back(result.trace[step].ellipse);
    if (id > 0) until = birth.at(id) + 1;
  }
  return ancestry;
}

}  // namespace

bool claimIsTrue(const SimulatedProblem& problem, const PointListSearch& search,
                 const MatchResult& result) {
  const std::vector<int>& matches = result.hypotheses.front().match_of_feature;
  const auto ancestry = ancestryOf(result);
  for (int f = 0; f < problem.prior.size(); ++f) {
    const int match = matches[slot(f)], truth = problem.true_point[slot(f)];
    if (match >= 0) {
      if (search.matches(f)[slot(match)].id != truth) return false;
    } else if (truth >= 0) {
      for (const SearchEllipse& ellipse : ancestry[slot(f)])
        if (mahalanobisSquared(ellipse, problem.points[slot(f)][slot(truth)]) <= kEllipseRadius2)
          return false;
    }
  }
  return true;
}

void Reliability::add(double weight, bool right) {
  const int last = static_cast<int>(counts_.size()) - 1;
  Count& count =
      counts_[slot(std::clamp(static_cast<int>(weight * static_cast<double>(last + 1)), 0, last))];
  ++count.frames;
  count.right += right;
  count.weight += weight;
  count.variance += weight * (1.0 - weight);
}

std::vector<ReliabilityBin> Reliability::bins() const {
  std::vector<ReliabilityBin> bins;
  for (const Count& count : counts_) {
    ReliabilityBin bin;
    bin.frames = count.frames;
    if (count.frames > 0) {
      bin.mean_weight = count.weight / count.frames;
      bin.fraction_correct = static_cast<double>(count.right) / count.frames;
      bin.sigma = std::sqrt(std::max(count.variance, 0.0)) / count.frames;
    }
    bins.push_back(bin);
  }
  return bins;
}

Reliability measureReliability(const std::string& matcher, int frames, int bins, std::uint64_t seed,
                               MatchOptions options) {
  std::vector<ProblemSimulator> simulators;
  for (const double clutter : {2e-5, 1e-4, 4e-4}) {
    SimulatedProblemOptions options;
    options.false_positive = clutter;
    simulators.emplace_back(options, ++seed);
  }
  SimulatedProblemOptions fast;
  fast.false_positive = 1e-4;
  fast.rate_hz = 15.0;
  simulators.emplace_back(fast, ++seed);
  options.keep_trace = true;
  const auto instance = createMatcher(matcher);
  Reliability reliability(bins);
  for (int n = 0; n < frames; ++n) {
    const SimulatedProblem problem = simulators[slot(n) % simulators.size()].next();
    PointListSearch search = problem.search();
    const MatchResult result = instance->match(problem.prior, search, options);
    reliability.add(result.statistics.accepted_weight, claimIsTrue(problem, search, result));
  }
  return reliability;
}

}  // namespace active_matching_slam
